"""An alert becomes a message in a chat: in Slack's format, which Mattermost and Rocket.Chat read too."""

import json
import os
import urllib.request

COLOURS = {"error": "#d33", "warning": "#e90", "info": "#39c"}
SIGNS = {"opened": "▲", "escalated": "▲", "resolved": "✓"}


def handler(event: dict, context) -> dict:
    """`event` is an alert's, as a rule gives it. A failure is raised: then the queue tries it again."""
    message = shaped(event["detail"])
    body = json.dumps(message).encode()
    # The same event may come twice: whoever reads this header knows it again.
    headers = {"Content-Type": "application/json", "Idempotency-Key": event["id"]}
    request = urllib.request.Request(os.environ["CHAT_URL"], body, headers, method="POST")
    with urllib.request.urlopen(request, timeout=5) as answer:
        print(f"told the chat: {message['text']} ({answer.status})")
    return {"told": message["text"]}


def shaped(alert: dict) -> dict:
    """The message."""
    sign = SIGNS.get(alert["what"], "·")
    text = f"{sign} {alert['robot']}: {alert['title']}"
    link = f"{os.environ.get('GATEWAY_URL', '')}/robots/{alert['robot']}"
    fields = [{"title": name, "value": str(alert[name]), "short": True} for name in ("severity", "state", "cause")]
    details = {"color": COLOURS.get(alert["severity"], "#888"), "text": alert["reason"], "fields": fields}
    return {"text": text, "attachments": [{**details, "title": alert["alert"], "title_link": link, "fallback": text}]}
