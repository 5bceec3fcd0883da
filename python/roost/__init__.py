"""Roost: simulations of chicken fillets in hoppers and tests, on this machine and at a server."""

from roost.client import Client as Client
