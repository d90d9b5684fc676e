//! Turns the records of a walk into one offline HTML page.
