{{/* Names, labels and what several objects share. */}}

{{- define "metaros.name" -}}
{{- default .Chart.Name .Values.nameOverride | trunc 40 | trimSuffix "-" }}
{{- end }}

{{- define "metaros.fullname" -}}
{{- if .Values.fullnameOverride }}
{{- .Values.fullnameOverride | trunc 40 | trimSuffix "-" }}
{{- else if contains (include "metaros.name" .) .Release.Name }}
{{- .Release.Name | trunc 40 | trimSuffix "-" }}
{{- else }}
{{- printf "%s-%s" .Release.Name (include "metaros.name" .) | trunc 40 | trimSuffix "-" }}
{{- end }}
{{- end }}

{{- define "metaros.selector" -}}
app.kubernetes.io/name: {{ include "metaros.name" . }}
app.kubernetes.io/instance: {{ .Release.Name }}
{{- end }}

{{- define "metaros.labels" -}}
helm.sh/chart: {{ printf "%s-%s" .Chart.Name .Chart.Version | replace "+" "_" }}
{{ include "metaros.selector" . }}
app.kubernetes.io/version: {{ .Chart.AppVersion | quote }}
app.kubernetes.io/managed-by: {{ .Release.Service }}
app.kubernetes.io/part-of: metaros
{{- with .Values.commonLabels }}
{{ toYaml . }}
{{- end }}
{{- end }}

{{/* Of one component: (list $ "gateway"). */}}
{{- define "metaros.componentSelector" -}}
{{- include "metaros.selector" (index . 0) }}
app.kubernetes.io/component: {{ index . 1 }}
{{- end }}

{{- define "metaros.componentLabels" -}}
{{- include "metaros.labels" (index . 0) }}
app.kubernetes.io/component: {{ index . 1 }}
{{- end }}

{{- define "metaros.image" -}}
{{- $image := .Values.image -}}
{{- if $image.registry }}{{ $image.registry }}/{{ end }}{{ $image.repository }}
{{- if $image.digest }}@{{ $image.digest }}{{ else }}:{{ $image.tag | default .Chart.AppVersion }}{{ end }}
{{- end }}

{{- define "metaros.serviceAccount" -}}
{{- if .Values.serviceAccount.create }}
{{- .Values.serviceAccount.name | default (include "metaros.fullname" .) }}
{{- else }}
{{- .Values.serviceAccount.name | default "default" }}
{{- end }}
{{- end }}

{{/* "true" or "": whether there is a PostgreSQL, and whether more than one process works on it. */}}
{{- define "metaros.shared" -}}
{{- if or .Values.database.existingSecret .Values.postgresql.nonProduction.enabled }}true{{ end }}
{{- end }}

{{- define "metaros.runners" -}}
{{- if and .Values.functions.enabled .Values.functions.runners.enabled }}true{{ end }}
{{- end }}

{{- define "metaros.clustered" -}}
{{- if or (gt (int .Values.replicas) 1) .Values.autoscaling.enabled (include "metaros.runners" .) }}true{{ end }}
{{- end }}

{{- define "metaros.routers" -}}
{{- if and (include "metaros.clustered" .) .Values.zenoh.enabled (not .Values.zenoh.endpoints) }}true{{ end }}
{{- end }}

{{/* The least number of gateways. */}}
{{- define "metaros.leastReplicas" -}}
{{- if .Values.autoscaling.enabled }}{{ .Values.autoscaling.minReplicas }}{{ else }}{{ .Values.replicas }}{{ end }}
{{- end }}

{{- define "metaros.tlsSecret" -}}
{{- if .Values.certificate.enabled }}{{ include "metaros.fullname" . }}-tls{{ else }}{{ .Values.tls.existingSecret }}{{ end }}
{{- end }}

{{- define "metaros.scheme" -}}
{{- if eq .Values.tls.mode "gateway" }}https{{ else }}http{{ end }}
{{- end }}

{{/* preStop, notice, commands and then requests under way, Goodbyes to robots (10 s), detectors' state (10 s), and some. */}}
{{- define "metaros.gracePeriod" -}}
{{- $drain := .Values.gateway.drain -}}
{{- add (int $drain.preStopSeconds) (int $drain.noticeSeconds) (mul 2 (int $drain.seconds)) 30 }}
{{- end }}

{{/* All routers; each is given all of them, and leaves itself out. */}}
{{- define "metaros.routerEndpoints" -}}
{{- $name := printf "%s-zenoh" (include "metaros.fullname" .) -}}
{{- $endpoints := list -}}
{{- range $ordinal := until (int .Values.zenoh.replicas) }}
{{- $endpoints = append $endpoints (printf "tcp/%s-%d.%s.%s.svc:%d" $name $ordinal $name $.Release.Namespace (int $.Values.zenoh.port)) }}
{{- end }}
{{- join "," $endpoints }}
{{- end }}

{{/* By which names the gateway may be called: its services', the routes' and yours. */}}
{{- define "metaros.hosts" -}}
{{- $name := include "metaros.fullname" . -}}
{{- $hosts := .Values.gateway.hosts -}}
{{- if .Values.ingress.enabled }}{{ $hosts = concat $hosts (list .Values.ingress.host .Values.ingress.grpc.host) }}{{ end }}
{{- if .Values.gatewayApi.enabled }}{{ $api := .Values.gatewayApi }}{{ $hosts = concat $hosts (list $api.host $api.grpc.host $api.robots.host) }}{{ end }}
{{- range $service := list $name (printf "%s-robots" $name) }}
{{- $hosts = concat $hosts (list (printf "%s.%s.svc" $service $.Release.Namespace) (printf "%s.%s" $service $.Release.Namespace) $service) }}
{{- end }}
{{- compact $hosts | uniq | toJson }}
{{- end }}

{{/* The port of the object store: what is set, else of its URL, else of S3. */}}
{{- define "metaros.objectsPort" -}}
{{- $endpoint := regexFind "endpoint=https?://[^/&]+" .Values.objects.url | trimPrefix "endpoint=" -}}
{{- $own := regexFind ":[0-9]+$" $endpoint | trimPrefix ":" -}}
{{- .Values.networkPolicy.egress.objects.port | int | default ($own | int) | default (hasPrefix "http:" $endpoint | ternary 80 443) }}
{{- end }}

{{/* With the policy Always the kubelet would let the group read every file again, and a gateway refuses such a key. */}}
{{- define "metaros.podSecurity" -}}
runAsNonRoot: true
runAsUser: 10001
runAsGroup: 10001
fsGroup: 10001
fsGroupChangePolicy: OnRootMismatch
seccompProfile:
  type: RuntimeDefault
{{- end }}

{{- define "metaros.containerSecurity" -}}
allowPrivilegeEscalation: false
readOnlyRootFilesystem: true
capabilities:
  drop: [ALL]
{{- end }}

{{- define "metaros.pull" -}}
image: {{ include "metaros.image" . | quote }}
imagePullPolicy: {{ .Values.image.pullPolicy }}
{{- end }}

{{/* What every pod begins with. */}}
{{- define "metaros.podBegin" -}}
automountServiceAccountToken: false
enableServiceLinks: false
{{- with .Values.imagePullSecrets }}
imagePullSecrets:
  {{- toYaml . | nindent 2 }}
{{- end }}
securityContext:
  {{- include "metaros.podSecurity" . | nindent 2 }}
{{- end }}

{{/* Where a pod goes: (nodeSelector, tolerations, affinity). */}}
{{- define "metaros.placement" -}}
{{- with .nodeSelector }}
nodeSelector:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .tolerations }}
tolerations:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .affinity }}
affinity:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- end }}

{{/* Where the store is; of gateways, runners and what prepares them. */}}
{{- define "metaros.storeEnv" -}}
- name: HOME
  value: /var/lib/metaros
- name: TMPDIR
  value: /tmp
{{- if .Values.database.existingSecret }}
- name: METAROS_STORE
  valueFrom:
    secretKeyRef:
      name: {{ .Values.database.existingSecret }}
      key: {{ .Values.database.key }}
{{- else if .Values.postgresql.nonProduction.enabled }}
- name: POSTGRES_PASSWORD
  valueFrom:
    secretKeyRef:
      name: {{ .Values.postgresql.nonProduction.existingSecret }}
      key: {{ .Values.postgresql.nonProduction.key }}
- name: METAROS_STORE
  value: postgresql://metaros:$(POSTGRES_PASSWORD)@{{ include "metaros.fullname" . }}-postgresql:5432/metaros
{{- end }}
{{- end }}

{{- define "metaros.migrateArgs" -}}
args:
  - gateway
  - store
  - migrate
  {{- if .Values.gateway.bootstrapAdmin }}
  - --admin
  {{- end }}
  - --data-dir
  - /var/lib/metaros/gateway
{{- end }}
