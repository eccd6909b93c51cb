"""Readers: a log in, tables by topic out."""

from flightlog.readers.folder import Flight, Tables, read_flight
from flightlog.readers.log import Log
from flightlog.readers.recognise import read_log
from flightlog.tables import Table

__all__ = ["Flight", "Log", "Table", "Tables", "read_flight", "read_log"]
