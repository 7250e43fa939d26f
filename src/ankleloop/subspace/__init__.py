"""Linear subspace identification; knows nothing of ankles."""

from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.input_matrices import estimate_input_matrices, response
from ankleloop.subspace.moesp import SubspaceEstimate, moesp

__all__ = ["SubspaceEstimate", "block_hankel", "estimate_input_matrices", "moesp", "response"]
