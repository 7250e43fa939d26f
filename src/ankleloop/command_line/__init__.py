"""The command `ankleloop`: recordings of a laboratory from files to results, without a workflow."""
