"""The CANopen client: connection, configuration and capture of a drive on the bus."""
