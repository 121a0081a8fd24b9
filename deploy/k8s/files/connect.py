"""What `helm test` does: SCHEME HOST HTTP_PORT PROGRAMS_PORT. /readyz says 200, and gRPC's health check says SERVING.

Nothing secret is sent and nothing is believed but a yes or no, so the certificate is not verified.
"""

import ssl
import sys
import urllib.request

import grpc
from grpc_health.v1 import health_pb2, health_pb2_grpc

scheme, host, http_port, programs_port = sys.argv[1:]
anybody = ssl.create_default_context()
anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE
with urllib.request.urlopen(f"{scheme}://{host}:{http_port}/readyz", timeout=10, context=anybody) as answer:
    print("readyz", answer.status, answer.read(1000).decode())
shown = ssl.get_server_certificate((host, int(programs_port)), timeout=10).encode()
credentials = grpc.ssl_channel_credentials(root_certificates=shown)
with grpc.secure_channel(f"{host}:{programs_port}", credentials) as channel:
    health = health_pb2_grpc.HealthStub(channel)
    status = health.Check(health_pb2.HealthCheckRequest(), timeout=10).status
    print("grpc", health_pb2.HealthCheckResponse.ServingStatus.Name(status))
sys.exit(status != health_pb2.HealthCheckResponse.SERVING)
