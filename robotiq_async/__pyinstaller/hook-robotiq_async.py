"""PyInstaller reads this when a program imports robotiq_async: the files that imports do not show."""

from importlib.util import find_spec

from PyInstaller.utils.hooks import collect_data_files, copy_metadata

# Tables, and the drawings of hands. The metadata name the packages of an extra.
datas = collect_data_files("robotiq_async") + copy_metadata("robotiq-async")
# The demo is imported by name; a wheel has it, a clone does not.
hiddenimports = [name for name in ("robotiq_async._demo",) if find_spec(name) is not None]
