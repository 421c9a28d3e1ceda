"""The flow of the method: stages A, B and C frame by frame, then D over everything."""
