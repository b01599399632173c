"""What `import fecore` and `import modalbase` give a user, named one by one: a name that goes or comes is a decision."""

import subprocess
import sys
from types import ModuleType

import pytest

import fecore
import modalbase

FECORE = """
    BeamSpecimen Dof Edge FecoreError ForwardModel FrfSet HoldOut Identification IdentificationError InputError
    MeasuredModes Measurement ModelError Options OrthotropicMaterial Parameter Ply PointMass Recipe Specimen Spring
    UpdateResult UpdatingError __version__ csac csf frac homogenise identify mac sac section update
"""
MODALBASE = """
    ClientError FormatError Frfs JobFailed Laboratory UffError __version__ connect read_machine_csv read_uff write_uff
"""


@pytest.mark.parametrize(("package", "names"), [(fecore, FECORE), (modalbase, MODALBASE)])
def test_the_exported_members_are_these(package: ModuleType, names: str) -> None:
    assert sorted(package.__all__) == sorted(names.split())
    for name in package.__all__:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = package.nonsense


def test_both_packages_have_one_version() -> None:
    assert fecore.__version__ == modalbase.__version__


@pytest.mark.parametrize(
    ("package", "heavy"),
    [
        ("fecore", "scipy"),
        ("modalbase", "numpy"),
        ("modalbase.formats", "fecore"),
        ("modalbase.client", "numpy"),
        ("modalbase.objects", "numpy"),
    ],
)
def test_an_import_brings_no_more_than_it_needs(package: str, heavy: str) -> None:
    code = f"import sys, {package}; print({heavy!r} in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
