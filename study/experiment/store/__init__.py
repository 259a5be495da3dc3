"""The database of answers: tables, migrations, sessions, participants, export."""
