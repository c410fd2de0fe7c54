"""The filter over cells that runs after the drive: what it needs, what it reads, and what its beliefs say."""
