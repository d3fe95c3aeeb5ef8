"""Optional dependencies of this package: the extra `links` of its pyproject.toml."""

from wakewise.core.optional_dependencies import OptionalDependencies

ARDUSUB = OptionalDependencies(
    "packages/wakewise-ardusub",
    {
        "links": {
            "pymavlink": "pymavlink",
            "mcap": "mcap",
            "lupa": "lupa",
            "serial": "pyserial",
            "smbus2": "smbus2",
        }
    },
)
need = ARDUSUB.need
