"""The last record of a matrix in binary OP4 files: one number that is no entry, counted as one word or as two."""

import struct

import numpy as np
import pytest

from mbsvib.common.op4_file import read_op4_file


def record(content):
    return struct.pack("<i", len(content)) + content + struct.pack("<i", len(content))


@pytest.mark.parametrize("words", [1, 2])
def test_a_closing_record_of_eight_bytes_may_count_one_word(words):
    file = b"".join((record(struct.pack("<4i8s", 1, 2, 2, 2, b"KAA     ")),
                     record(struct.pack("<3i2d", 1, 1, 4, 3.0, -4.5)),
                     record(struct.pack("<3id", 2, 1, words, 1.0))))  # fmt: skip
    np.testing.assert_array_equal(read_op4_file(file)["KAA"], [[3.0], [-4.5]])
