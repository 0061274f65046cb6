-- Devices stream into sessions.
CREATE TABLE binding (
    device TEXT PRIMARY KEY,
    session INTEGER NOT NULL REFERENCES session ON DELETE CASCADE,
    nonce TEXT NOT NULL, token BLOB NOT NULL, key TEXT NOT NULL, pose_hz REAL NOT NULL) STRICT;
CREATE UNIQUE INDEX binding_of_session ON binding (session)
