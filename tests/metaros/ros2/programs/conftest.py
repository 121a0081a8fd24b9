"""A workspace of packages that nobody has built."""

from __future__ import annotations

from pathlib import Path

import pytest

SETUP = """
from setuptools import find_packages, setup
package_name = 'my_robot'
setup(
    name=package_name,
    version='1.2.3',
    packages=find_packages(exclude=['test']),
    data_files=[('share/' + package_name, ['package.xml'])],
    entry_points={
        'console_scripts': [
            'talker = my_robot.talker:main',
            'listener = ' + package_name + '.nodes.listener:main',
            f'server = {package_name}.server:Server.run',
        ],
    },
)
"""


def package(folder: Path, name: str) -> Path:
    """An empty package."""
    folder.mkdir(parents=True)
    xml = f'<?xml version="1.0"?>\n<package format="3">\n  <!-- <name>x</name> -->\n  <name>{name}</name>\n</package>\n'
    (folder / "package.xml").write_text(xml)
    return folder


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """Two packages of Python, one of CMake with scripts, one that colcon would ignore, one that was built."""
    robot = package(tmp_path / "src" / "robots" / "my_robot", "my_robot")
    (robot / "setup.py").write_text(SETUP)
    (robot / "my_robot").mkdir()
    (robot / "my_robot" / "__init__.py").touch()
    (robot / "my_robot" / "talker.py").write_text(
        "import sys\nfrom my_robot import __file__ as here\ndef main():\n    print(sys.argv)\n    return 3\n"
    )
    other = package(tmp_path / "src" / "other", "other")
    (other / "setup.cfg").write_text("[options.entry_points]\nconsole_scripts =\n    one = other.one:main\n")
    (other / "pyproject.toml").write_text('[project.scripts]\ntwo = "other.two:main"\n')
    tools = package(tmp_path / "src" / "tools", "tools")
    (tools / "scripts").mkdir()
    (tools / "scripts" / "spin.py").write_text("print('spin', __name__)\n")
    (tools / "scripts" / "turn").write_text("#!/usr/bin/env python3\n")
    (tools / "scripts" / "data.txt").touch()
    package(tmp_path / "src" / "off", "off")
    (tmp_path / "src" / "off" / "COLCON_IGNORE").touch()
    package(tmp_path / "install" / "built", "built")
    return tmp_path
