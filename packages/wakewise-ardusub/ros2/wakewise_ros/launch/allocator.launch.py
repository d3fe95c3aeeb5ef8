"""Start the node with a file of parameters; topics are remapped in the usual way."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """One node; `config:=FILE` and `odometry:=TOPIC` say otherwise."""
    given = Path(get_package_share_directory("wakewise_ros")) / "config" / "bluerov2_heavy.yaml"
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=str(given), description="File of parameters"),
            DeclareLaunchArgument("odometry", default_value="odom", description="Topic of the vehicle's pose"),
            Node(
                package="wakewise_ros",
                executable="allocator",
                name="wakewise",
                output="screen",
                parameters=[LaunchConfiguration("config")],
                remappings=[("~/odometry", LaunchConfiguration("odometry"))],
            ),
        ]
    )
