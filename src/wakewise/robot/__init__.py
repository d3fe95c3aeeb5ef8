"""Robot: vehicles and their dynamics (`vehicles/`), thrusters (`thrusters/`), readers of vehicle files
(`importers/`).
"""
