"""Records of a run: log, truth, results, reference files; and the observers that write them."""
