"""What a run of the fleet measured, as JSON and as one page of HTML."""
