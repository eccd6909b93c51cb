"""Readers: a log in, tables by topic out."""

from flightlog.readers.folder import Flight, Tables, read_flight
from flightlog.tables import Table

__all__ = ["Flight", "Table", "Tables", "read_flight"]
