{{/* The gateway's pod, of gateways and of function runners: (dict "root" $ "component" "gateway"|"runner"). */}}

{{- define "metaros.gatewayArgs" -}}
{{- $root := .root -}}
{{- $values := $root.Values -}}
{{- $gateway := $values.gateway -}}
{{- $arguments := list "gateway" "--host" "0.0.0.0" "--data-dir" "/var/lib/metaros/gateway" -}}
{{- $arguments = concat $arguments (list "--port" $gateway.ports.http "--grpc-port" $gateway.ports.robots "--api-grpc-port" $gateway.ports.programs) -}}
{{- $arguments = concat $arguments (list "--foxglove-port" ($gateway.ports.foxglove | default "off") "--rosbridge-port" ($gateway.ports.rosbridge | default "off")) -}}
{{- if eq $values.tls.mode "proxy" }}
{{- $arguments = concat $arguments (list "--tls" "off") }}
{{- end }}
{{- range $values.tls.trustedProxies }}{{ $arguments = concat $arguments (list "--trusted-proxy" .) }}{{ end }}
{{- if include "metaros.tlsSecret" $root }}
{{- $arguments = concat $arguments (list "--tls-cert" "/etc/metaros/tls/tls.crt" "--tls-key" "/etc/metaros/tls/tls.key") }}
{{- end }}
{{- range include "metaros.hosts" $root | fromJsonArray }}{{ $arguments = concat $arguments (list "--allow-host" .) }}{{ end }}
{{- range $gateway.origins }}{{ $arguments = concat $arguments (list "--allow-origin" .) }}{{ end }}
{{- with $gateway.fleet }}{{ $arguments = concat $arguments (list "--fleet" .) }}{{ end }}
{{- if not $gateway.alerts }}{{ $arguments = append $arguments "--no-alerts" }}{{ end }}
{{- if or (not $values.functions.enabled) (and (include "metaros.runners" $root) (eq .component "gateway")) }}
{{- $arguments = append $arguments "--no-functions" }}
{{- else }}
{{- $arguments = concat $arguments (list "--sandbox-require" $values.functions.sandboxRequire "--function-workers" $values.functions.workers "--function-egress" $values.functions.egress) }}
{{- end }}
{{- if include "metaros.clustered" $root }}
{{- $endpoints := join "," $values.zenoh.endpoints | default (include "metaros.routerEndpoints" $root) }}
{{- $arguments = concat $arguments (list "--cluster" $endpoints) }}
{{- end }}
{{- if $gateway.issuer.existingSecret }}
{{- $arguments = concat $arguments (list "--ca-cert" "/etc/metaros/issuer/tls.crt" "--ca-key" "/etc/metaros/issuer/tls.key") }}
{{- end }}
{{- if $gateway.oidc.existingSecret }}
{{- $arguments = concat $arguments (list "--oidc" (printf "/etc/metaros/oidc/%s" $gateway.oidc.key)) }}
{{- end }}
{{- if $gateway.notify.existingSecret }}
{{- $arguments = concat $arguments (list "--notify" (printf "/etc/metaros/notify/%s" $gateway.notify.key)) }}
{{- end }}
{{- with $gateway.aws.endpoint }}{{ $arguments = concat $arguments (list "--aws-endpoint" .) }}{{ end }}
{{- with $gateway.aws.region }}{{ $arguments = concat $arguments (list "--aws-region" .) }}{{ end }}
{{- range $gateway.webhookPrivate }}{{ $arguments = concat $arguments (list "--webhook-private" .) }}{{ end }}
{{- $arguments = concat $arguments (list "--robot-certificate-hours" $gateway.robotCertificateHours "--heartbeat-s" $gateway.heartbeatSeconds) -}}
{{- $keep := $gateway.retention -}}
{{- $arguments = concat $arguments (list "--retention-days" $keep.days "--event-retention-days" $keep.eventDays "--retention-mib" $keep.mib) -}}
{{- range $keep.rules }}{{ $arguments = concat $arguments (list "--retention" .) }}{{ end }}
{{- $limits := $gateway.limits -}}
{{- $arguments = concat $arguments (list "--robot-messages-per-s" $limits.robotMessagesPerSecond "--robot-bytes-per-s" $limits.robotBytesPerSecond) -}}
{{- $arguments = concat $arguments (list "--requests-per-s" $limits.requestsPerSecond "--anonymous-requests-per-s" $limits.anonymousRequestsPerSecond) -}}
{{- $arguments = concat $arguments (list "--robot-requests-per-s" $limits.robotRequestsPerSecond "--sign-ins-per-min" $limits.signInsPerMinute) -}}
{{- $arguments = concat $arguments (list "--drain-notice-s" $gateway.drain.noticeSeconds "--drain-s" $gateway.drain.seconds) -}}
{{- $arguments = concat $arguments (list "--log-format" $gateway.log.format "--log-level" $gateway.log.level) -}}
{{- with $gateway.otlp }}{{ $arguments = concat $arguments (list "--otlp" .) }}{{ end }}
{{- range $place, $argument := concat $arguments $gateway.extraArgs }}
{{- if $place }}{{ "\n" }}{{ end }}
{{- /* A number of values.yaml is a float: 67108864 would be 6.7108864e+07. */}}
{{- if and (kindIs "float64" $argument) (eq $argument (floor $argument)) }}{{ $argument = int64 $argument }}{{ end -}}
- {{ $argument | toString | quote }}
{{- end }}
{{- end }}

{{- define "metaros.gatewayEnv" -}}
{{- include "metaros.storeEnv" . }}
{{- with .Values.objects.url }}
- name: METAROS_OBJECTS
  value: {{ . | quote }}
{{- end }}
{{- with .Values.objects.existingSecret }}
- name: AWS_ACCESS_KEY_ID
  valueFrom:
    secretKeyRef:
      name: {{ . }}
      key: {{ $.Values.objects.accessKeyIdKey }}
- name: AWS_SECRET_ACCESS_KEY
  valueFrom:
    secretKeyRef:
      name: {{ . }}
      key: {{ $.Values.objects.secretAccessKeyKey }}
{{- end }}
{{- if .Values.masterKey.existingSecret }}
- name: METAROS_MASTER_KEY
  value: /etc/metaros/master/{{ .Values.masterKey.key }}
{{- end }}
{{- with .Values.gateway.extraEnv }}
{{ toYaml . }}
{{- end }}
{{- end }}

{{- define "metaros.secretMounts" -}}
{{- $gateway := .Values.gateway -}}
{{- $secrets := dict "master" .Values.masterKey.existingSecret "tls" (include "metaros.tlsSecret" .) "issuer" $gateway.issuer.existingSecret -}}
{{- merge $secrets (dict "oidc" $gateway.oidc.existingSecret "notify" $gateway.notify.existingSecret) | toJson }}
{{- end }}

{{- define "metaros.gatewayPod" -}}
{{- $root := .root -}}
{{- $component := .component -}}
{{- $gateway := $root.Values.gateway -}}
{{- $own := eq $component "gateway" | ternary $gateway $root.Values.functions.runners -}}
metadata:
  labels:
    {{- include "metaros.componentLabels" (list $root $component) | nindent 4 }}
    metaros/serves: metrics
    {{- with $gateway.podLabels }}
    {{- toYaml . | nindent 4 }}
    {{- end }}
  annotations:
    checksum/config: {{ include "metaros.gatewayArgs" . | sha256sum }}
    {{- with $gateway.podAnnotations }}
    {{- toYaml . | nindent 4 }}
    {{- end }}
spec:
  {{- include "metaros.podBegin" $root | nindent 2 }}
  serviceAccountName: {{ include "metaros.serviceAccount" $root }}
  terminationGracePeriodSeconds: {{ include "metaros.gracePeriod" $root }}
  {{- with $gateway.priorityClassName }}
  priorityClassName: {{ . }}
  {{- end }}
  {{- with include "metaros.placement" $own | trim }}
  {{- . | nindent 2 }}
  {{- end }}
  topologySpreadConstraints:
    {{- range $key, $skew := dict "topology.kubernetes.io/zone" $gateway.topologySpread.zoneMaxSkew "kubernetes.io/hostname" $gateway.topologySpread.nodeMaxSkew }}
    - maxSkew: {{ $skew }}
      topologyKey: {{ $key }}
      whenUnsatisfiable: {{ $gateway.topologySpread.whenUnsatisfiable }}
      labelSelector:
        matchLabels:
          {{- include "metaros.componentSelector" (list $root $component) | nindent 10 }}
    {{- end }}
  {{- if not $root.Values.database.existingSecret }}
  initContainers:
    - name: migrate
      {{- include "metaros.pull" $root | nindent 6 }}
      securityContext:
        {{- include "metaros.containerSecurity" $root | nindent 8 }}
      {{- include "metaros.migrateArgs" $root | nindent 6 }}
      env:
        {{- include "metaros.storeEnv" $root | nindent 8 }}
      resources:
        {{- toYaml $root.Values.migrations.resources | nindent 8 }}
      volumeMounts:
        {{- include "metaros.dataMounts" $root | nindent 8 }}
  {{- end }}
  containers:
    - name: gateway
      {{- include "metaros.pull" $root | nindent 6 }}
      securityContext:
        {{- include "metaros.containerSecurity" $root | nindent 8 }}
      args:
        {{- include "metaros.gatewayArgs" . | nindent 8 }}
      env:
        {{- include "metaros.gatewayEnv" $root | nindent 8 }}
      ports:
        {{- range $name, $port := $gateway.ports }}
        {{- if $port }}
        - name: {{ $name }}
          containerPort: {{ $port }}
          protocol: TCP
        {{- end }}
        {{- end }}
      {{- /* The kubelet calls the pod by its address; localhost is a name of every gateway. */}}
      startupProbe:
        httpGet: &alive
          path: /healthz
          port: http
          scheme: {{ include "metaros.scheme" $root | upper }}
          httpHeaders: [{name: Host, value: localhost}]
        periodSeconds: 2
        timeoutSeconds: 2
        failureThreshold: 90
      livenessProbe:
        httpGet: *alive
        periodSeconds: 10
        timeoutSeconds: 5
        failureThreshold: 6
      readinessProbe:
        httpGet:
          path: /readyz
          port: http
          scheme: {{ include "metaros.scheme" $root | upper }}
          httpHeaders: [{name: Host, value: localhost}]
        periodSeconds: 3
        timeoutSeconds: 3
        failureThreshold: 2
      lifecycle:
        preStop:
          sleep:
            seconds: {{ $gateway.drain.preStopSeconds }}
      resources:
        {{- toYaml $own.resources | nindent 8 }}
      volumeMounts:
        {{- include "metaros.dataMounts" $root | nindent 8 }}
        {{- range $name, $secret := include "metaros.secretMounts" $root | fromJson }}
        {{- if $secret }}
        - name: {{ $name }}
          mountPath: /etc/metaros/{{ $name }}
          readOnly: true
        {{- end }}
        {{- end }}
        {{- with $gateway.extraVolumeMounts }}
        {{- toYaml . | nindent 8 }}
        {{- end }}
  volumes:
    {{- include "metaros.dataVolumes" $root | nindent 4 }}
    {{- range $name, $secret := include "metaros.secretMounts" $root | fromJson }}
    {{- if $secret }}
    - name: {{ $name }}
      secret:
        secretName: {{ $secret }}
        defaultMode: 0400
    {{- end }}
    {{- end }}
    {{- with $gateway.extraVolumes }}
    {{- toYaml . | nindent 4 }}
    {{- end }}
{{- end }}

{{- define "metaros.dataMounts" -}}
- name: data
  mountPath: /var/lib/metaros
- name: tmp
  mountPath: /tmp
{{- end }}

{{- define "metaros.dataVolumes" -}}
- name: tmp
  emptyDir:
    sizeLimit: {{ .Values.gateway.temporary.tmp }}
- name: data
  {{- if or (include "metaros.shared" .) (not .Values.persistence.enabled) }}
  emptyDir:
    sizeLimit: {{ .Values.gateway.temporary.data }}
  {{- else }}
  persistentVolumeClaim:
    claimName: {{ .Values.persistence.existingClaim | default (printf "%s-data" (include "metaros.fullname" .)) }}
  {{- end }}
{{- end }}
