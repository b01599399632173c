# ruff: noqa: E501 - a row of the table of bad files is one line
"""Models as matrices, in the forms in which solvers hand them out."""

import io

import numpy as np
import pytest
import scipy
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.models.matrices import MatrixModel, read_matrices
from tests.support.lengths import fuzz, long

NUMBERS = np.array([10, 7, 30])
PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [2.0, 0.0, 0.0]])
NODES = b"node,x,y,z\n10,0,0,0\n7,1,0,.5\n30,2,0,0\n"


def symmetric(seed: int, size: int = 18) -> np.ndarray:
    rng = np.random.default_rng(seed)
    full = np.where(rng.random((size, size)) < 0.3, rng.normal(size=(size, size)), 0.0)
    return full + full.T + np.diag(np.arange(1.0, size + 1))


K, K_SKIN, M = symmetric(1), symmetric(2), symmetric(3)
LABELS = [(int(node), dof) for node in NUMBERS for dof in range(1, 7)]


def market(matrix: np.ndarray, symmetry: str = "symmetric") -> bytes:
    stream = io.BytesIO()
    scipy.io.mmwrite(stream, scipy.sparse.coo_array(matrix), symmetry=symmetry, precision=17)
    return stream.getvalue()


def calculix(matrix: np.ndarray) -> bytes:
    rows, columns = np.nonzero(np.triu(matrix))
    return "".join(
        f"{i + 1} {j + 1} {matrix[i, j]:.17e}\n" for i, j in zip(rows, columns, strict=True)
    ).encode()


def abaqus(matrix: np.ndarray) -> bytes:
    rows, columns = np.nonzero(np.triu(matrix))
    lines = [f"{LABELS[i][0]},{LABELS[i][1]}, {LABELS[j][0]},{LABELS[j][1]}, {matrix[i, j]:.17e}"
             for i, j in zip(rows, columns, strict=True)]  # fmt: skip
    return "\n".join(["** Assembly", *lines]).encode()


def punched(matrix: np.ndarray, name: str) -> str:
    """As EXTSEOUT(DMIGPCH) writes it: a symmetric one by half, each column a card."""
    lines = [f"DMIG    {name:8s}{0:8d}{6:8d}{2:8d}{0:8d}"]
    for j, (grid, component) in enumerate(LABELS):
        below = [i for i in np.flatnonzero(matrix[:, j]) if i >= j]
        if below:
            lines.append(f"DMIG*   {name:16s}{grid:16d}{component:16d}")
        lines += [
            f"*       {LABELS[i][0]:16d}{LABELS[i][1]:16d}{matrix[i, j]:16.9E}".replace("E", "D")
            for i in below
        ]
    return "\n".join(lines) + "\n"


def same(model: MatrixModel, tolerance: float = 1e-14) -> None:
    assert dict(zip(model.numbers.tolist(), model.nodes.tolist(), strict=True)) == dict(
        zip(NUMBERS.tolist(), PLACES.tolist(), strict=True)
    )
    order = [LABELS.index((int(model.numbers[row]), int(dof) + 1)) for row, dof in model.dofs]
    assert sorted(order) == list(range(18))
    expected = {"0": K, "skin": K_SKIN}
    assert set(model.stiffness) <= set(expected)
    for name, matrix in model.stiffness.items():
        assert matrix.toarray() == pytest.approx(
            expected[name][np.ix_(order, order)], abs=tolerance * 30
        )
    assert model.mass["0"].toarray() == pytest.approx(M[np.ix_(order, order)], abs=tolerance * 30)


def test_matrix_market() -> None:
    files = {
        "K_0.mtx": market(K),
        "K_skin.mtx": market(K_SKIN, "general"),
        "M_0.mtx": market(M),
        "nodes.csv": NODES,
    }
    model = read_matrices(files)
    same(model)
    assert set(model.stiffness) == {"0", "skin"}
    dense = (
        b"%%MatrixMarket matrix array real symmetric\n% by hand\n18 18\n"
        + "\n".join(f"{K[i, j]:.17e}" for j in range(18) for i in range(j, 18)).encode()
    )
    same(read_matrices({**files, "K_0.mtx": dense}))


def test_calculix_storage_with_its_table_of_dofs() -> None:
    order = np.random.default_rng(0).permutation(18)
    dofs = "".join(f"{LABELS[i][0]}.{LABELS[i][1]}\n" for i in order).encode()
    turned = np.ix_(order, order)
    same(
        read_matrices(
            {
                "b.sti": calculix(K[turned]),
                "b.mas": calculix(M[turned]),
                "b.dof": dofs,
                "nodes.csv": NODES,
            }
        )
    )


def test_abaqus_by_node_and_dof() -> None:
    files = {
        "wing_STIF1.mtx": abaqus(K),
        "wing_MASS1.mtx": abaqus(M),
        "K_skin.mtx": abaqus(K_SKIN),
        "nodes.csv": NODES,
    }
    same(read_matrices(files))


def test_a_punch_with_its_grids() -> None:
    grids = "CORD2R,4,,1.,0.,.5,1.,0.,1.\n,2.,0.,.5\nGRID,10,,0.,0.,0.\nGRID,7,4,0.,0.,0.\nGRID,30,,2.,0.,0.\n"
    text = "$ punch\n" + punched(K, "KAAX") + punched(K_SKIN, "KSKIN") + punched(M, "MAAX") + grids
    model = read_matrices({"wing.pch": text.encode()}, {"KSKIN": "K_skin"})
    same(model, 1e-9)
    assert set(model.stiffness) == {"0", "skin"}


def test_an_archive_dense_and_sparse() -> None:
    sparse = scipy.sparse.csr_array(K_SKIN)
    stream = io.BytesIO()
    np.savez(
        stream, K_0=K, M_0=M, K_skin_data=sparse.data, K_skin_indices=sparse.indices, K_skin_indptr=sparse.indptr,
        nodes=np.column_stack([NUMBERS, PLACES]), dofs=np.array(LABELS),
    )  # fmt: skip
    same(read_matrices({"model.npz": stream.getvalue()}))
    with pytest.raises(FormatError, match="holds more than 100 bytes"):
        read_matrices({"model.npz": stream.getvalue()}, limit_bytes=100)


def test_three_dofs_of_each_node() -> None:
    part = np.ix_(range(9), range(9))
    model = read_matrices(
        {"K_0.mtx": market(K[part]), "M_0.mtx": market(M[part]), "nodes.csv": NODES}
    )
    assert model.dofs.tolist() == [[row, dof] for row in range(3) for dof in range(3)]


GOOD = {"K_0.mtx": market(K), "M_0.mtx": market(M), "nodes.csv": NODES}
LOPSIDED = K + np.triu(np.ones((18, 18)))
HEAD = b"%%MatrixMarket matrix coordinate real symmetric\n"
BAD = [
    ({"nodes.csv": None}, "nodes.csv", "is missing"),
    ({"M_0.mtx": None}, "M_0", "there is no matrix of the mass"),
    ({"stiffness.mtx": market(K)}, "stiffness.mtx", "has no role; call it K_0"),
    ({"K_0.txt": b""}, "K_0.txt", "is not known: expected .mtx"),
    ({"job.sti": calculix(K)}, "job.sti", "is a second K_0"),
    ({"K_0.mtx": market(LOPSIDED, "general")}, "K_0.mtx", "is not symmetric"),
    ({"K_0.mtx": market(K)[:-200]}, "K_0.mtx", "it seems to be cut"),
    ({"K_0.mtx": market(K[:17, :17])}, "K_0.mtx", "has 17 rows, the table of dofs 18"),
    ({"K_0.mtx": HEAD + b"18 18 1\n1 1 nan\n"}, "K_0.mtx", "not a finite number"),
    ({"K_0.mtx": HEAD + b"18 18 1\n1 1 x\n"}, "K_0.mtx", "holds what is not a number"),
    ({"K_0.mtx": HEAD + b"18 18 1\n1 1.5 2\n"}, "K_0.mtx", "not a whole number"),
    ({"K_0.mtx": HEAD + b"18 18 1\n1 19 2\n"}, "K_0.mtx", "has an entry in row 19, and there are 18 dofs"),
    ({"K_0.mtx": HEAD + b"18 17 0\n"}, "K_0.mtx", "has 18 rows and 17 columns"),
    ({"K_0.mtx": HEAD.replace(b"real", b"complex")}, "K_0.mtx line 1", "says complex symmetric"),
    ({"K_0.mtx": b"hello"}, "K_0.mtx", "holds what is not a number"),
    ({"dofs.csv": b"node,dof\n10,1\n10,1\n"}, "dofs", "names a dof twice"),
    ({"dofs.csv": b"node,dof\n10,7\n"}, "dofs.csv line 2", "has the dof 7, expected 1"),
    ({"dofs.csv": b"node,dof\n11,1\n"}, "dofs", "names node 11, which is not in the table of nodes"),
    ({"nodes.csv": b"node,x,y\n1,2,3\n"}, "nodes.csv line 1", "is 'node,x,y', expected node,x,y,z"),
    ({"nodes.csv": b"node,x,y,z\n1,2,3,a\n"}, "nodes.csv line 2, z", "expected a number"),
    ({"nodes.csv": NODES + b"7,1,1,1\n"}, "nodes", "has a number twice"),
    ({"nodes.csv": NODES + b"8,1,1,1\n"}, "dofs.csv", "matrices of 18 rows are neither six nor three of each of 4 nodes"),
    ({"K_0.mtx": b"10,1, 99,1, 5.\n", "M_0.mtx": abaqus(M)}, "dofs", "names node 99"),
    ({"K_0.npz": b"PK nothing"}, "K_0.npz", "is no npz archive"),
    ({"a.pch": punched(K, "KAAX").replace("       6       2", "       6       4", 1).encode()}, "line 1", "TIN (field 5) is '4', expected 1 or 2, real"),
    ({"a.pch": b"DMIG*   KAAX                          10               1\n*                     10               1 1.0D+00\n"}, "line 1", "expected a matrix whose header"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "place", "message"), BAD)
def test_what_does_not_fit_is_named(change, place, message) -> None:
    files = {name: content for name, content in {**GOOD, **change}.items() if content is not None}
    with pytest.raises(FormatError) as caught:
        read_matrices(files)
    assert caught.value.place == place
    assert message in caught.value.message


WHOLE = [
    ("K_0.mtx", market(K)[:400]), ("K_0.mtx", abaqus(K)[:300]), ("k.sti", calculix(K)[:300]), ("a.pch", punched(K, "KAAX").encode()[:600]),
    ("b.dof", b"10.1\n10.2\n7.3\n"), ("dofs.csv", b"node,dof\n10,1\n7,2\n"), ("nodes.csv", NODES),
]  # fmt: skip


def read_or_refused(damage: tuple[tuple[str, bytes], int, bytes, int]) -> None:
    (name, content), at, new, gone = damage
    result: object = None
    try:
        result = read_matrices({**GOOD, name: content[:at] + new + content[at + gone :]})
    except FormatError as error:
        result = error
    assert isinstance(result, MatrixModel | FormatError)


@pytest.mark.parametrize("examples", [150, long(500)])
def test_a_damaged_file_is_read_or_refused(examples: int) -> None:
    damage = (st.sampled_from(WHOLE), st.integers(0, 600), st.binary(max_size=4), st.integers(0, 5))
    fuzz(examples, st.tuples(*damage), read_or_refused)
