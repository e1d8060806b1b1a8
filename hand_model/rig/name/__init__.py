"""What a balance of effort lacks: candidates compete in one regression."""
