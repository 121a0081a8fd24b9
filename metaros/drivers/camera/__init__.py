"""The camera driver: OpenCV sources to sensor_msgs/CompressedImage."""
