"""Builds a package of actions for ROS from their definitions, as colcon would (of which there is no wheel).

package.py FOLDER OUT: the package has the folder's name, and its definitions are in FOLDER/action. Afterwards OUT
belongs into AMENT_PREFIX_PATH, OUT/lib into LD_LIBRARY_PATH, and OUT/python into PYTHONPATH.
"""

import pathlib
import subprocess
import sys
import sysconfig

import numpy
from ament_index_python import get_package_share_directory
from rosidl_adapter.action import convert_action_to_idl
from rosidl_cli.command.helpers import legacy_generator_arguments_file
from rosidl_generator_c.cli import GenerateC
from rosidl_generator_py.cli import GeneratePython
from rosidl_generator_type_description.cli import HashTypeDescription
from rosidl_typesupport_c import generate_c
from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

ROS = pathlib.Path(sys.prefix)
# What the package's library is asked for, by these names: here it is one, with all of it.
PARTS = ("generator_c", "typesupport_c", "typesupport_fastrtps_c", "typesupport_introspection_c")
# What every action needs, and the packages whose messages are in these.
USED = ("action_msgs", "builtin_interfaces", "geometry_msgs", "service_msgs", "std_msgs", "unique_identifier_msgs")

definitions, out = (pathlib.Path(argument).absolute() for argument in sys.argv[1:])
name = definitions.name
share, sources, libraries = out / "share" / name, out / "sources", out / "lib"
others = [str(ROS / "share")]


def folder(part):
    """The generators' files have the same names: each writes into a folder of its own."""
    path = out / "python" / name if part == "python" else sources / part / name
    path.mkdir(parents=True)
    return path


def compile_(source):
    compiled = source.with_suffix(source.suffix + ".o")
    headers = [*sources.iterdir(), ROS / "include", *(ROS / "include").iterdir(), sysconfig.get_paths()["include"],
               numpy.get_include()]
    subprocess.run(["g++" if source.suffix == ".cpp" else "gcc", "-c", "-fPIC", "-w", source, "-o", compiled,
                    *(f"-I{header}" for header in headers)], check=True)
    return compiled


actions = sorted(path.name for path in (definitions / "action").glob("*.action"))
for action in actions:
    convert_action_to_idl(definitions, name, pathlib.Path("action", action), share / "action")
interfaces = [f"{share}:action/{pathlib.Path(action).stem}.idl" for action in actions]
hashes = HashTypeDescription("").generate_type_hashes(name, interfaces, others, share)

GenerateC("").generate(name, interfaces, others, folder("c"), hashes)
GenerateIntrospectionCTypesupport("").generate(name, interfaces, others, folder("introspection"))
GenerateFastRTPSCTypesupport("").generate(name, interfaces, others, folder("fastrtps"))
templates = pathlib.Path(get_package_share_directory("rosidl_typesupport_c"), "resource")
with legacy_generator_arguments_file(package_name=name, interface_files=interfaces, include_paths=others,
                                     templates_path=templates, output_path=folder("handles")) as arguments:
    generate_c(arguments, ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"])
python = folder("python")
GeneratePython("", typesupport_implementations=["rosidl_typesupport_c"]).generate(name, interfaces, others, python)
(python / "__init__.py").touch()

compiled = [compile_(source) for place in (sources, python) for source in sorted(place.rglob("*.c*"))]
linked = [f"{package}__rosidl_{part}" for package in USED for part in (*PARTS, "generator_py")]
linked += [f"rosidl_{part}" for part in PARTS[1:]] + [
    "rosidl_typesupport_fastrtps_cpp", "rosidl_runtime_c", "rcutils", "rmw", "fastcdr"]
libraries.mkdir()
library = libraries / f"lib{name}.so"
subprocess.run(["g++", "-shared", *compiled, "-o", library, f"-L{ROS}/lib", "-Wl,--allow-shlib-undefined",
                *(f"-l{one}" for one in linked)], check=True)
for part in PARTS:
    (libraries / f"lib{name}__rosidl_{part}.so").symlink_to(library)
(python / f"{name}_s__rosidl_typesupport_c.so").symlink_to(library)

index = out / "share/ament_index/resource_index/rosidl_interfaces"
index.mkdir(parents=True)
(index / name).write_text("".join(f"action/{action}\naction/{pathlib.Path(action).stem}.idl\n" for action in actions))
