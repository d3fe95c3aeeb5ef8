"""Build with colcon; `wakewise` itself is installed from its clone, as the README has it."""

from setuptools import setup

NAME = "wakewise_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/allocator.launch.py"]),
        (f"share/{NAME}/config", ["config/bluerov2_heavy.yaml"]),
    ],
    install_requires=["setuptools", "wakewise"],
    zip_safe=True,
    license="Apache-2.0",
    entry_points={"console_scripts": [f"allocator = {NAME}.node:main"]},
)
