"""Processes that execute calls: on this computer or on a cluster; independent of robots."""
