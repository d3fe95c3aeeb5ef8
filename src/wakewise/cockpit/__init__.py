"""The pilot's page: a flight in the browser, its helm, and who may hold it."""
