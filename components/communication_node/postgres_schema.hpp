#pragma once
#include <array>
#include <string_view>

// Private to this folder. The tables and functions of a store in PostgreSQL, all in the schema `atirma`. Script n
// brings version n to n+1. Times are milliseconds since 1970 (UTC), as packets have them.
namespace atirma::postgres_schema {

// Partitions by month of the measurement, from 2000 on and up to a month ahead; what a wrong clock puts elsewhere is in
// packets_other. A month whose packets came there before moves into its partition.
inline constexpr std::string_view first = R"sql(
CREATE SCHEMA atirma;
CREATE TABLE atirma.meta(version integer NOT NULL);
INSERT INTO atirma.meta VALUES (0);
CREATE TABLE atirma.boats(
  number integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY, boat text NOT NULL UNIQUE,
  life bigint NOT NULL, cluster text NOT NULL, head bigint NOT NULL DEFAULT 0, commands_head bigint NOT NULL DEFAULT 0,
  epoch bigint NOT NULL DEFAULT 0, change bigint NOT NULL DEFAULT 0);
CREATE TABLE atirma.lives(
  place bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, boat integer NOT NULL REFERENCES atirma.boats,
  life bigint NOT NULL, packets bigint NOT NULL, commands bigint NOT NULL);
CREATE TABLE atirma.nodes(
  boat integer NOT NULL REFERENCES atirma.boats, node text NOT NULL, seen timestamptz NOT NULL, PRIMARY KEY (boat, node));
CREATE TABLE atirma.packets(
  boat integer NOT NULL, boot integer NOT NULL, sequence bigint NOT NULL, measured bigint NOT NULL,
  position bigint NOT NULL, received bigint NOT NULL, link smallint NOT NULL, kind smallint NOT NULL,
  history boolean NOT NULL, raw bytea NOT NULL) PARTITION BY RANGE (measured);
CREATE INDEX packets_by_number ON atirma.packets (boat, boot, sequence);
CREATE INDEX packets_by_position ON atirma.packets (boat, position);
CREATE INDEX packets_of_boat ON atirma.packets (boat, measured, position);
CREATE INDEX packets_by_time ON atirma.packets USING brin (measured);
CREATE TABLE atirma.packets_other PARTITION OF atirma.packets DEFAULT;
CREATE TABLE atirma.newest(
  boat integer NOT NULL REFERENCES atirma.boats, kind smallint NOT NULL, measured bigint NOT NULL,
  PRIMARY KEY (boat, kind));
CREATE TABLE atirma.commands(
  number bigint GENERATED ALWAYS AS IDENTITY, boat integer NOT NULL REFERENCES atirma.boats, id bigint NOT NULL,
  position bigint NOT NULL, open boolean NOT NULL, asked_by text NOT NULL, weight smallint NOT NULL,
  changed bigint NOT NULL, node text NOT NULL, record text NOT NULL, PRIMARY KEY (boat, id));
CREATE INDEX commands_by_change ON atirma.commands (boat, position);
CREATE INDEX commands_by_number ON atirma.commands (boat, number);
CREATE TABLE atirma.authority(
  boat integer NOT NULL REFERENCES atirma.boats, epoch bigint NOT NULL, change bigint NOT NULL, state text NOT NULL,
  PRIMARY KEY (boat, epoch));
CREATE TABLE atirma.retention(boat text NOT NULL, kind smallint NOT NULL, days integer NOT NULL CHECK (days > 0),
  PRIMARY KEY (boat, kind));
COMMENT ON TABLE atirma.retention IS
  'days that packets are kept; boat ''*'' is all boats, kind -1 all kinds; the most particular rule counts';

CREATE FUNCTION atirma.make_partitions(times bigint[]) RETURNS void LANGUAGE plpgsql AS $$
DECLARE
  month timestamp; here text; low bigint; high bigint;
BEGIN
  FOR month IN SELECT DISTINCT date_trunc('month', to_timestamp(t / 1000.0) AT TIME ZONE 'UTC') FROM unnest(times) AS t
      WHERE t >= 946684800000 AND t < extract(epoch FROM now() + interval '31 days') * 1000 LOOP
    here := 'packets_' || to_char(month, 'YYYY_MM');
    CONTINUE WHEN to_regclass('atirma.' || here) IS NOT NULL;
    PERFORM pg_advisory_xact_lock(hashtext('atirma.packets'));
    CONTINUE WHEN to_regclass('atirma.' || here) IS NOT NULL;
    low := extract(epoch FROM month AT TIME ZONE 'UTC') * 1000;
    high := extract(epoch FROM (month + interval '1 month') AT TIME ZONE 'UTC') * 1000;
    EXECUTE format('CREATE TABLE atirma.%I (LIKE atirma.packets INCLUDING ALL)', here);
    EXECUTE format('WITH moved AS (DELETE FROM atirma.packets_other WHERE measured >= %s AND measured < %s RETURNING *) '
      'INSERT INTO atirma.%I SELECT * FROM moved', low, high, here);
    EXECUTE format('ALTER TABLE atirma.packets ATTACH PARTITION atirma.%I FOR VALUES FROM (%s) TO (%s)', here, low, high);
  END LOOP;
END $$;

CREATE FUNCTION atirma.open_boat(of text, fresh bigint) RETURNS SETOF atirma.boats LANGUAGE plpgsql AS $$
DECLARE
  b atirma.boats; now_here text;
BEGIN
  -- The timeline that is written now; pg_control_checkpoint() has that of the last checkpoint.
  SELECT system_identifier || '/' || left(pg_walfile_name(pg_current_wal_lsn()), 8) INTO now_here
    FROM pg_control_system();
  INSERT INTO atirma.boats(boat, life, cluster) VALUES (of, fresh, now_here) ON CONFLICT DO NOTHING;
  SELECT * INTO b FROM atirma.boats WHERE boat = of FOR UPDATE;
  IF b.cluster <> now_here THEN
    INSERT INTO atirma.lives(boat, life, packets, commands) VALUES (b.number, b.life, b.head, b.commands_head);
    UPDATE atirma.boats SET life = fresh, cluster = now_here WHERE number = b.number;
  END IF;
  RETURN QUERY SELECT * FROM atirma.boats WHERE number = b.number;
END $$;

CREATE FUNCTION atirma.know_newest(of integer, after bigint) RETURNS void LANGUAGE sql AS $$
  INSERT INTO atirma.newest AS n (boat, kind, measured)
    SELECT of, kind, max(least(measured, received)) FROM atirma.packets
      WHERE boat = of AND position > after AND NOT history GROUP BY kind
    ON CONFLICT (boat, kind) DO UPDATE SET measured = excluded.measured WHERE excluded.measured > n.measured
$$;

CREATE FUNCTION atirma.keep(of integer, boots integer[], sequences bigint[], times bigint[], links smallint[],
    receptions bigint[], histories boolean[], contents bytea[], OUT last bigint, OUT fresh integer, OUT head_now bigint)
    LANGUAGE plpgsql AS $$
DECLARE
  b atirma.boats;
BEGIN
  SELECT * INTO b FROM atirma.boats WHERE number = of FOR UPDATE;
  PERFORM atirma.make_partitions(times);
  WITH given AS MATERIALIZED (
    SELECT DISTINCT ON (boot, sequence, measured, raw) * FROM
      unnest(boots, sequences, times, links, receptions, histories, contents) WITH ORDINALITY
        AS g(boot, sequence, measured, link, received, history, raw, place)
      ORDER BY boot, sequence, measured, raw, place),
  looked AS MATERIALIZED (
    SELECT g.*, (SELECT min(p.position) FROM atirma.packets p WHERE p.boat = of AND p.boot = g.boot
      AND p.sequence = g.sequence AND p.measured = g.measured AND p.raw = g.raw) AS known FROM given g),
  added AS (
    INSERT INTO atirma.packets(boat, boot, sequence, measured, position, received, link, kind, history, raw)
      SELECT of, boot, sequence, measured, b.head + row_number() OVER (ORDER BY place), received, link,
        get_byte(raw, 1), history, raw FROM looked WHERE known IS NULL
      RETURNING position)
  SELECT greatest(coalesce(max(position), 0), (SELECT coalesce(max(known), 0) FROM looked)), count(*)
    INTO last, fresh FROM added;
  head_now := b.head + fresh;
  IF fresh > 0 THEN
    UPDATE atirma.boats SET head = head_now WHERE number = of;
    INSERT INTO atirma.newest AS n (boat, kind, measured)
      SELECT of, get_byte(raw, 1), max(least(measured, received))
        FROM unnest(times, receptions, histories, contents) AS g(measured, received, history, raw)
        WHERE NOT history GROUP BY 2
      ON CONFLICT (boat, kind) DO UPDATE SET measured = excluded.measured WHERE excluded.measured > n.measured;
  END IF;
END $$;

CREATE FUNCTION atirma.look(of integer, by text, OUT head bigint, OUT commands_head bigint, OUT epoch bigint,
    OUT change bigint, OUT life bigint, OUT nodes text[], OUT seen text[]) LANGUAGE plpgsql AS $$
BEGIN
  PERFORM set_config('synchronous_commit', 'off', true); -- a sign of life may be lost
  INSERT INTO atirma.nodes VALUES (of, by, clock_timestamp())
    ON CONFLICT (boat, node) DO UPDATE SET seen = clock_timestamp();
  SELECT b.head, b.commands_head, b.epoch, b.change, b.life INTO head, commands_head, epoch, change, life
    FROM atirma.boats b WHERE b.number = of;
  SELECT array_agg(n.node ORDER BY n.node), array_agg(n.seen::text ORDER BY n.node) INTO nodes, seen
    FROM atirma.nodes n WHERE n.boat = of AND n.node <> by;
END $$;

CREATE FUNCTION atirma.begin_command(of integer, under bigint, with_id bigint, by text, ended smallint, at bigint,
    giver text, content text, OUT outcome text, OUT known text) LANGUAGE plpgsql AS $$
DECLARE
  b atirma.boats;
BEGIN
  SELECT * INTO b FROM atirma.boats WHERE number = of FOR UPDATE;
  SELECT record INTO known FROM atirma.commands WHERE boat = of AND id = with_id;
  IF known IS NOT NULL THEN
    outcome := 'known';
  ELSIF b.epoch <> under THEN
    outcome := 'other authority';
  ELSE
    INSERT INTO atirma.commands(boat, id, position, open, asked_by, weight, changed, node, record)
      VALUES (of, with_id, b.commands_head + 1, true, by, ended, at, giver, content);
    UPDATE atirma.boats SET commands_head = b.commands_head + 1 WHERE number = of;
    outcome := 'begun';
  END IF;
END $$;

CREATE FUNCTION atirma.put_commands(of integer, ids bigint[], opens boolean[], askers text[], weights smallint[],
    changes bigint[], givers text[], contents text[]) RETURNS void LANGUAGE plpgsql AS $$
DECLARE
  b atirma.boats;
BEGIN
  SELECT * INTO b FROM atirma.boats WHERE number = of FOR UPDATE;
  FOR i IN 1 .. coalesce(array_length(ids, 1), 0) LOOP
    INSERT INTO atirma.commands AS c (boat, id, position, open, asked_by, weight, changed, node, record)
      VALUES (of, ids[i], b.commands_head + 1, opens[i], askers[i], weights[i], changes[i], givers[i], contents[i])
      ON CONFLICT (boat, id) DO UPDATE SET position = excluded.position, open = excluded.open,
        weight = excluded.weight, changed = excluded.changed, node = excluded.node, record = excluded.record
        WHERE (excluded.weight, excluded.changed, excluded.node) >= (c.weight, c.changed, c.node);
    IF FOUND THEN b.commands_head := b.commands_head + 1; END IF;
  END LOOP;
  UPDATE atirma.boats SET commands_head = b.commands_head WHERE number = of;
END $$;

CREATE FUNCTION atirma.put_authority(of integer, before_epoch bigint, before_change bigint, with_epoch bigint,
    with_change bigint, content text) RETURNS boolean LANGUAGE plpgsql AS $$
DECLARE
  b atirma.boats;
BEGIN
  SELECT * INTO b FROM atirma.boats WHERE number = of FOR UPDATE;
  IF (b.epoch, b.change) <> (before_epoch, before_change) THEN RETURN false; END IF;
  INSERT INTO atirma.authority VALUES (of, with_epoch, with_change, content)
    ON CONFLICT (boat, epoch) DO UPDATE SET change = excluded.change, state = excluded.state;
  UPDATE atirma.boats SET epoch = with_epoch, change = with_change WHERE number = of;
  RETURN true;
END $$;

CREATE FUNCTION atirma.prune(of integer, keep_commands bigint) RETURNS bigint LANGUAGE plpgsql AS $$
DECLARE
  rule record; removed bigint := 0; gone bigint; until bigint;
BEGIN
  FOR rule IN SELECT DISTINCT ON (k.kind) k.kind, r.days
      FROM (SELECT kind FROM atirma.newest WHERE boat = of UNION SELECT kind FROM atirma.retention WHERE kind >= 0) k
      JOIN atirma.retention r ON r.kind IN (k.kind, -1) AND r.boat IN ((SELECT boat FROM atirma.boats WHERE number = of), '*')
      ORDER BY k.kind, r.boat = '*', r.kind = -1 LOOP
    until := extract(epoch FROM now() - make_interval(days => rule.days)) * 1000;
    DELETE FROM atirma.packets p USING (SELECT measured, position FROM atirma.packets WHERE boat = of AND kind = rule.kind
        AND measured < until AND received < until ORDER BY measured LIMIT 5000) old
      WHERE p.boat = of AND p.position = old.position AND p.measured = old.measured;
    GET DIAGNOSTICS gone = ROW_COUNT;
    removed := removed + gone;
  END LOOP;
  DELETE FROM atirma.commands WHERE boat = of AND number IN (SELECT number FROM atirma.commands WHERE boat = of AND NOT open
    ORDER BY number DESC OFFSET keep_commands LIMIT 2000);
  GET DIAGNOSTICS gone = ROW_COUNT;
  RETURN removed + gone;
END $$;
)sql";

// Grows a file, as packets do: on a full tablespace a statement that stores nothing succeeds.
inline constexpr std::string_view second = R"sql(
CREATE TABLE atirma.probe(filling text NOT NULL);
ALTER TABLE atirma.probe ALTER COLUMN filling SET STORAGE PLAIN; -- a page a row
CREATE FUNCTION atirma.probe() RETURNS void LANGUAGE plpgsql AS $$
BEGIN
  TRUNCATE atirma.probe;
  INSERT INTO atirma.probe SELECT repeat('x', 8000) FROM generate_series(1, 16);
END $$;
)sql";

inline constexpr std::array<std::string_view, 2> scripts{first, second};
inline constexpr std::int64_t version = scripts.size();

} // namespace atirma::postgres_schema
