"""Instructions are counted along the way that an invocation takes."""

import pytest

from lab.benchmarks.shaders.machine_code import Loop, MachineCode

# A loop over pixels, two over layers, and an instruction that the disassembler does not know.
ASSEMBLY = """BB0:
	v_mov_b32_e32 v0, 0                                         ; 7e000280
BB1:
	v_add_f32_e32 v1, v1, v2                                    ; 06020501
	s_cbranch_scc0 BB1                                          ; bfa1fffe
BB2:
	v_fma_f32 v1, v1, v2, v3                                    ; d6130001 040e0501
	(then repeated 2 times)
	s_cbranch_scc0 BB2                                          ; bfa1fff9
BB3:
	v_pk_fma_f16 v1, v1, v2, v3                                 ; cc0e4001 1c0e0501
	v_fmac_f32_e32 v1, v2, v3                                   ; 56020702
(invalid instruction)                                        ; d59c0080
(invalid instruction)                                        ; 00000080
	s_cbranch_execnz BB3                                        ; bfa6fffa
	s_cbranch_execz BB4                                         ; bfa50001
	buffer_store_b32 v1, v0, s[0:3], 0                          ; e0680000
BB4:
	s_endpgm                                                    ; bfb00000
"""


def test_loops_are_found_by_their_code() -> None:
    code = MachineCode.parsed(ASSEMBLY)
    assert code.loops == (Loop(1, 2), Loop(3, 6), Loop(7, 11))


def test_layers_run_as_often_as_they_have_blocks() -> None:
    code = MachineCode.parsed(ASSEMBLY)
    assert code.vector_instructions((16, 16)) == 1 + 1 + 3 * 16 + 3 * 16 + 1


def test_what_pixels_share_is_divided_among_them() -> None:
    code = MachineCode.parsed(ASSEMBLY)
    assert code.vector_instructions((4, 16), pixels=4) == 1 / 4 + 1 + 3 * 4 / 4 + 3 * 16 / 4 + 1 / 4


def test_a_network_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="3 loops, and the network 4"):
        MachineCode.parsed(ASSEMBLY).vector_instructions((1, 2, 3, 4))
