"""An identity provider for tests: Canaille with all data in memory.

Call: provider.py ADDRESS_OF_ROOST. It prints its own address, and answers until its end.
"""

import logging
import socket
import sys

from canaille import create_app
from canaille.app import models
from canaille.backends import Backend
from werkzeug.serving import make_server

# A user has checked the address if the display name says so: Canaille itself has no such state.
VERIFIED = "{% if user.display_name != 'unverified' %}true{% endif %}"

listener = socket.create_server(("127.0.0.2", 0))
address = "%s:%d" % listener.getsockname()
config = {
    "SECRET_KEY": "of a test",
    # Without it, Canaille answers 500 to a wrong secret of a client.
    "SERVER_NAME": address,
    "PREFERRED_URL_SCHEME": "http",
    "CACHE_TYPE": "SimpleCache",
    "CANAILLE": {"DATABASE": "memory", "JAVASCRIPT": False, "HTMX": False},
    "CANAILLE_OIDC": {},
}
app = create_app(config)
app.config["CANAILLE_OIDC"]["USERINFO_MAPPING"]["EMAIL_VERIFIED"] = VERIFIED
backend = Backend.instance
query_one = backend.do_query


def query_all(model, **filters):
    """Finds what fits all filters. Canaille's backend in memory finds what fits one of them, such as any code of a client."""
    found = [query_one(model, **{name: value}) for name, value in filters.items()] or [query_one(model)]
    ids = set.intersection(*({instance.id for instance in instances} for instances in found))
    return [instance for instance in found[0] if instance.id in ids]


backend.do_query = query_all
with app.app_context():
    users = {}
    for name, display_name in [("ada", "Ada"), ("bob", "Bob"), ("eve", "unverified")]:
        users[name] = models.User(
            user_name=name,
            formatted_name=name,
            family_name=name,
            display_name=display_name,
            emails=[f"{name}@lab.example"],
            password="correct horse",
        )
        backend.save(users[name])
    backend.save(models.Group(display_name="scientists", members=[users["ada"], users["eve"]]))
    clients = {}
    for client in ["roost", "other"]:
        clients[client] = models.Client(
            client_id=client,
            client_name=client,
            client_secret="secret of the client",
            redirect_uris=[f"{site}/dashboard/sign-in/callback" for site in (sys.argv[1], "https://roost.example")],
            response_types=["code"],
            grant_types=["authorization_code"],
            scope=["openid", "profile", "email", "groups"],
            token_endpoint_auth_method="client_secret_basic",
        )
        backend.save(clients[client])
    for client in clients.values():
        # ID tokens of both clients are for the first one.
        client.audience = [clients["roost"]]
        backend.save(client)
logging.getLogger("werkzeug").setLevel(logging.ERROR)
server = make_server("127.0.0.2", 0, app, threaded=True, fd=listener.fileno())
print(f"http://{address}", flush=True)
server.serve_forever()
