"""Linear subspace identification of any linear system; nothing here depends on joints."""

from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.input_matrices import simulate_response
from ankleloop.subspace.moesp import SubspaceEstimate, moesp

__all__ = ["SubspaceEstimate", "block_hankel", "moesp", "simulate_response"]
