"""What is tested here needs the extra `links`, and Lua for the script and the stand-in."""

from importlib.util import find_spec

collect_ignore_glob = [] if find_spec("pymavlink") and find_spec("lupa") else ["test_*.py"]
