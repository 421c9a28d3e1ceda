"""Speed and accuracy, alone and beside other programs."""
