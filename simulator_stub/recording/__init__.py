"""What a run leaves: log, truth, results, reference files; and the observers that write them."""
