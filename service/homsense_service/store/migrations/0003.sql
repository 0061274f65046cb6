-- Devices stream into sessions.
CREATE TABLE binding (
    device TEXT PRIMARY KEY,
    session INTEGER NOT NULL REFERENCES session ON DELETE CASCADE,
    nonce TEXT NOT NULL, token BLOB NOT NULL) STRICT;
CREATE INDEX binding_of_session ON binding (session)
