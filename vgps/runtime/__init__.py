"""What every run needs beside the method: progress, time per stage, threads, memory."""
