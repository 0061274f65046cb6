-- Scans are packed: landmarks are numbers. Sessions, keys and checkpoints are kept.
ALTER TABLE site RENAME TO site_1;
ALTER TABLE map RENAME TO map_1;
ALTER TABLE scan RENAME TO scan_1;
CREATE TABLE site (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, config TEXT NOT NULL,
    revision INTEGER NOT NULL) STRICT;
CREATE TABLE map (
    site INTEGER PRIMARY KEY REFERENCES site ON DELETE CASCADE, document TEXT NOT NULL) STRICT;
CREATE TABLE landmark (
    number INTEGER PRIMARY KEY, site INTEGER NOT NULL REFERENCES site ON DELETE CASCADE,
    name TEXT NOT NULL, UNIQUE (site, name)) STRICT;
CREATE TABLE scan (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    site INTEGER NOT NULL REFERENCES site ON DELETE CASCADE,
    device TEXT NOT NULL, scan_id TEXT NOT NULL, observed_at REAL NOT NULL,
    readings BLOB NOT NULL, track TEXT,
    UNIQUE (site, device, scan_id)) STRICT;
CREATE INDEX scan_of_site ON scan (site);
CREATE TABLE checkpoint (
    site INTEGER PRIMARY KEY REFERENCES site ON DELETE CASCADE,
    through INTEGER NOT NULL, key TEXT NOT NULL, body BLOB NOT NULL) STRICT;
CREATE TABLE session (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE,
    site INTEGER NOT NULL REFERENCES site ON DELETE CASCADE,
    opened_at REAL NOT NULL, document TEXT NOT NULL) STRICT;
CREATE INDEX session_of_site ON session (site);
CREATE TABLE event (
    session INTEGER NOT NULL REFERENCES session ON DELETE CASCADE,
    number INTEGER NOT NULL, seq INTEGER NOT NULL, fingerprint BLOB NOT NULL, body BLOB NOT NULL,
    UNIQUE (session, number)) STRICT;
CREATE TABLE snapshot (
    session INTEGER NOT NULL REFERENCES session ON DELETE CASCADE,
    number INTEGER NOT NULL, body BLOB NOT NULL, UNIQUE (session, number)) STRICT;
CREATE TABLE artifact (digest TEXT PRIMARY KEY, body BLOB NOT NULL) STRICT;
CREATE TABLE artifact_of_session (
    session INTEGER NOT NULL REFERENCES session ON DELETE CASCADE,
    digest TEXT NOT NULL REFERENCES artifact, PRIMARY KEY (session, digest)) STRICT;
CREATE INDEX session_of_artifact ON artifact_of_session (digest);
CREATE TABLE api_key (
    name TEXT PRIMARY KEY, hashed BLOB NOT NULL UNIQUE, scopes TEXT NOT NULL, sites TEXT,
    created_at REAL NOT NULL) STRICT;
INSERT INTO site (name, config, revision) SELECT id, config, 1 FROM site_1;
INSERT INTO map SELECT s.number, m.document FROM map_1 m JOIN site s ON s.name = m.site;
