#include <components/communication_node/postgres_store.hpp>

#include <components/communication_node/postgres_rows.hpp>
#include <components/communication_node/postgres_schema.hpp>

#include <ise/core/environment.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace atirma {
namespace {

using namespace std::chrono_literals;
using namespace postgres_rows_of;

constexpr ise::duration look_every = 500ms;
constexpr std::size_t command_page = 256;

std::int64_t bounded(std::uint64_t value) {
    return static_cast<std::int64_t>(
        std::min(value, static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())));
}

postgres_value milliseconds(const std::optional<utc_time>& at) {
    return at ? postgres_value(std::to_string(at->time_since_epoch().count())) : std::nullopt;
}

/// The result of `use` for the rows, or the failure that it throws.
template <class Use>
auto used(const postgres_rows& rows, Use& use) -> ise::result<decltype(use(rows))> {
    try {
        if constexpr (std::is_void_v<decltype(use(rows))>) {
            use(rows);
            return {};
        } else {
            return use(rows);
        }
    } catch (const ise::error& problem) {
        return problem.why();
    }
}

} // namespace

postgres_store::postgres_store(ise::loop& on, postgres_store_options options)
    : loop_(on), options_(std::move(options)), look_(on, [this] { look(); }),
      client_(on, options_.url, {[this] { greet(); }, [this](const ise::failure& why) { fail(why); }}) {}

postgres_store::~postgres_store() = default;

std::string postgres_store::name() const { return postgres_name(options_.url); }

ise::task<ise::result<node_store::memory>> postgres_store::opened() {
    store_answer<memory> answer(loop_);
    on_opened_ = answer.here();
    client_.start();
    auto got = co_await answer.get();
    co_return got;
}

template <class T, class Use>
void postgres_store::ask(std::string_view sql, std::vector<postgres_value> bound, then<T> done, Use use) {
    if (!ready_)
        return done(refusal_ ? *refusal_ : ise::failure(ise::errc::io_failed, name() + ": is being connected to"));
    client_.query(
        std::string(sql), std::move(bound),
        [this, done = std::move(done), use](ise::result<postgres_rows> rows) mutable {
            if (!rows) return done(rows.error());
            auto made = used(*rows, use);
            if (!made)
                return done(ise::failure(ise::errc::io_failed, fmt::format("{}: {}", name(), made.error().message())));
            done(std::move(made));
        });
}

// --- the connection ---------------------------------------------------------------------------------------------

void postgres_store::fail(const ise::failure& why) {
    ready_ = false;
    looking_ = reading_commands_ = false;
    look_.disarm();
    for (auto& [node, one] : others_) one.seen.clear(); // nobody could tell that it lives
    if (!refusal_) refusal_ = why;
    if (on_opened_) return std::exchange(on_opened_, {})(*std::exchange(refusal_, {}));
    if (news_.lost) news_.lost(*refusal_);
}

void postgres_store::greet() {
    refusal_.reset();
    client_.query("SELECT to_regclass('atirma.meta') IS NOT NULL", {}, [this](ise::result<postgres_rows> rows) {
        if (!rows) return client_.drop(rows.error());
        if (text_of(rows->at(0), 0) != "t") {
            refusal_ = ise::failure(
                ise::errc::io_failed,
                fmt::format("{} has no tables of A-Tirma yet: run atirma store migrate URL once, as the owner of the "
                            "database",
                            name()));
            return client_.drop(*refusal_);
        }
        client_.query("SELECT version FROM atirma.meta", {}, [this](ise::result<postgres_rows> found) {
            if (!found) return client_.drop(found.error());
            if (auto good = check_version(name(), *found); !good) {
                refusal_ = good.error();
                return client_.drop(*refusal_);
            }
            // Acknowledged data are on the server's disk, and on that of its synchronous standby, whatever its default.
            client_.query("SELECT set_config('synchronous_commit', CASE WHEN current_setting('synchronous_commit') IN "
                          "('off', 'local') THEN 'on' ELSE current_setting('synchronous_commit') END, false)",
                          {}, [this](ise::result<postgres_rows> set) {
                              if (!set) client_.drop(set.error());
                          });
            auto fresh = (loop_.env().random() >> 1) | 1u; // never 0, and without a sign
            client_.query("SELECT number, life, head, commands_head FROM atirma.open_boat($1, $2)",
                          {options_.boat, std::to_string(fresh)}, [this](ise::result<postgres_rows> boat) {
                              if (!boat) return client_.drop(boat.error());
                              greeted(*boat);
                          });
        });
    });
}

void postgres_store::greeted(const postgres_rows& rows) {
    const auto& row = rows.at(0);
    auto former = lives_.now.store;
    lives_ = store_lives();
    boat_ = integer_of(row, 0);
    lives_.now.store = number_of(row, 1);
    lives_.now.packets = number_of(row, 2);
    lives_.now.commands = number_of(row, 3);
    bool went_back = former != 0 && former != lives_.now.store;
    if (former == 0) commands_read_ = lives_.now.commands; // the open ones are read as a whole
    else if (went_back) commands_read_ = 0;
    client_.query(fmt::format("SELECT life, packets, commands FROM atirma.lives WHERE boat = $1 ORDER BY place DESC "
                              "LIMIT {}",
                              store_lives::most),
                  {std::to_string(boat_)}, [this, went_back](ise::result<postgres_rows> lives) {
                      if (!lives) return client_.drop(lives.error());
                      for (const auto& former_life : *lives) {
                          auto& life = lives_.over.emplace_back();
                          life.store = number_of(former_life, 0);
                          life.packets = number_of(former_life, 1);
                          life.commands = number_of(former_life, 2);
                      }
                      ready_ = true;
                      if (on_opened_) return remember();
                      if (went_back && news_.went_back) news_.went_back();
                      look();
                  });
}

void postgres_store::remember() {
    memory_ = memory();
    auto boat = std::to_string(boat_);
    client_.query("SELECT kind, measured FROM atirma.newest WHERE boat = $1", {boat},
                  [this](ise::result<postgres_rows> rows) {
                      if (!rows) return;
                      for (const auto& row : *rows)
                          memory_.newest.emplace_back(static_cast<std::uint8_t>(integer_of(row, 0)), time_of(row, 1));
                  });
    client_.query(fmt::format("SELECT {} FROM atirma.packets WHERE boat = $1 AND kind = 1 AND NOT history AND measured "
                              ">= (SELECT measured FROM atirma.newest WHERE boat = $1 AND kind = 1) ORDER BY measured "
                              "DESC LIMIT 1",
                              columns_of_packet),
                  {boat}, [this](ise::result<postgres_rows> rows) {
                      if (!rows) return;
                      for (auto& packet : packets_in(*rows)) memory_.last_location = std::move(packet);
                  });
    then<std::vector<command_record>> opened = [this](ise::result<std::vector<command_record>> open) {
        if (open) memory_.open_commands = std::move(*open);
    };
    ask<std::vector<command_record>>(
        "SELECT record FROM atirma.commands WHERE boat = $1 AND open ORDER BY number LIMIT 1000", {boat},
        std::move(opened), [](const postgres_rows& rows) { return records_in(rows); });
    then<std::optional<change_of_authority>> known = [this](ise::result<std::optional<change_of_authority>> state) {
        if (!on_opened_) return; // the connection was lost
        auto done = std::exchange(on_opened_, {});
        if (!state) return done(state.error());
        if (*state) {
            memory_.authority = **state;
            authority_ = {memory_.authority.first.epoch, memory_.authority.second};
        }
        done(std::move(memory_));
        look();
    };
    ask<std::optional<change_of_authority>>(authority_query, {boat}, std::move(known),
                                            [](const postgres_rows& rows) { return authority_in(rows); });
}

// --- what other nodes do ----------------------------------------------------------------------------------------

void postgres_store::look() {
    if (!ready_) return;
    look_.arm(ise::saturating_add(loop_.now(), look_every));
    if (std::exchange(looking_, true)) return;
    client_.query("SELECT head, commands_head, epoch, change, life, array_to_string(nodes, E'\\n'), "
                  "array_to_string(seen, E'\\n') FROM atirma.look($1, $2)",
                  {std::to_string(boat_), options_.node}, [this](ise::result<postgres_rows> rows) {
                      looking_ = false;
                      if (rows) looked(*rows);
                      else if (news_.lost) news_.lost(rows.error());
                  });
}

void postgres_store::looked(const postgres_rows& rows) {
    const auto& row = rows.at(0);
    if (number_of(row, 4) != lives_.now.store)
        return client_.drop(ise::failure(ise::errc::io_failed, fmt::format("{} began another life", name())));
    lives_.now.packets = std::max(lives_.now.packets, number_of(row, 0));
    lives_.now.commands = std::max(lives_.now.commands, number_of(row, 1));
    if (news_.packets) news_.packets();
    if (std::pair(static_cast<std::uint32_t>(integer_of(row, 2)), number_of(row, 3)) != authority_) read_authority();
    read_commands();
    auto nodes = lines_of(text_of(row, 5)), seen = lines_of(text_of(row, 6));
    for (std::size_t i = 0; i < std::min(nodes.size(), seen.size()); ++i) {
        auto& one = others_[nodes[i]];
        if (one.seen != seen[i]) {
            one.seen = seen[i];
            one.at = loop_.now();
            one.lost = false;
        }
    }
    watch_nodes();
}

void postgres_store::watch_nodes() {
    for (auto& [node, one] : others_)
        if (!one.lost && loop_.now() - one.at >= options_.silence) {
            one.lost = true;
            if (news_.node_lost) news_.node_lost(node);
        }
}

void postgres_store::read_authority() {
    then<std::optional<change_of_authority>> known = [this](ise::result<std::optional<change_of_authority>> state) {
        if (!state || !*state) return;
        authority_ = {(*state)->first.epoch, (*state)->second};
        if (news_.authority) news_.authority(**state);
    };
    ask<std::optional<change_of_authority>>(authority_query, {std::to_string(boat_)}, std::move(known),
                                            [](const postgres_rows& rows) { return authority_in(rows); });
}

void postgres_store::read_commands() {
    if (commands_read_ >= lives_.now.commands || std::exchange(reading_commands_, true)) return;
    client_.query(fmt::format("SELECT record, position FROM atirma.commands WHERE boat = $1 AND position > $2 ORDER BY "
                              "position LIMIT {}",
                              command_page),
                  {std::to_string(boat_), std::to_string(commands_read_)}, [this](ise::result<postgres_rows> rows) {
                      reading_commands_ = false;
                      if (!rows) return;
                      bool more = rows->size() == command_page;
                      commands_read_ = more ? number_of(rows->back(), 1)
                                            : std::max(commands_read_, rows->empty() ? lives_.now.commands
                                                                                     : number_of(rows->back(), 1));
                      std::vector<command_record> records;
                      for (const auto& row : *rows)
                          if (auto record = read_json<command_record>(text_of(row, 0)))
                              records.push_back(std::move(*record));
                      if (news_.commands) news_.commands(records);
                      if (more) read_commands();
                  });
}

// --- packets ----------------------------------------------------------------------------------------------------

std::vector<telemetry_packet> postgres_store::packets_in(const postgres_rows& rows, std::size_t from) const {
    std::vector<telemetry_packet> made;
    for (const auto& row : rows) {
        made.push_back(packet_in(row, from));
        made.back().store = number();
    }
    return made;
}

void postgres_store::add(std::vector<telemetry_packet> packets, then<kept> done) {
    if (packets.empty())
        return ask<kept>("SELECT atirma.probe()", {}, std::move(done), [](const postgres_rows&) { return kept(); });
    packet_arrays arrays(packets);
    ask<kept>("SELECT last, fresh, head_now FROM atirma.keep($1, $2, $3, $4, $5, $6, $7, $8)",
              {std::to_string(boat_), arrays.boots, arrays.sequences, arrays.times, arrays.links, arrays.receptions,
               arrays.histories, arrays.contents},
              std::move(done), [this](const postgres_rows& rows) {
                  kept made;
                  made.last = number_of(rows.at(0), 0);
                  made.fresh = static_cast<std::uint32_t>(integer_of(rows.at(0), 1));
                  lives_.now.packets = std::max(lives_.now.packets, number_of(rows.at(0), 2));
                  return made;
              });
}

void postgres_store::packets(std::uint64_t after, std::uint64_t up_to, std::size_t most,
                             then<std::vector<telemetry_packet>> done) {
    ask<std::vector<telemetry_packet>>(
        fmt::format("SELECT {} FROM atirma.packets WHERE boat = $1 AND position > $2 AND position <= $3 ORDER BY "
                    "position LIMIT {}",
                    columns_of_packet, most),
        {std::to_string(boat_), std::to_string(bounded(after)), std::to_string(bounded(up_to))}, std::move(done),
        [this](const postgres_rows& rows) { return packets_in(rows); });
}

// With a window of time the positions come from the index by time alone; the order of positions would read the whole
// voyage for a few late packets. The window stands twice: only then the server looks for the rows in its partitions
// alone, and finds them by their positions.
void postgres_store::track(const track_request& request, std::uint64_t up_to, then<track_page> done) {
    auto after = lives_.known_by(request.seen);
    auto most = std::size_t{request.max_packets};
    bool window = request.from || request.until;
    auto chosen = window ? "AND measured >= coalesce($4, -9223372036854775808) AND measured < coalesce($5, "
                           "9223372036854775807)"
                         : "AND $4::bigint IS NULL AND $5::bigint IS NULL";
    auto sql = fmt::format("SELECT {0} FROM atirma.packets p JOIN (SELECT position AS at, measured AS then FROM "
                           "atirma.packets WHERE boat = $1 AND position > $2 AND position <= $3 {1} ORDER BY position "
                           "LIMIT {2}) wanted ON p.boat = $1 AND p.position = wanted.at AND p.measured = wanted.then "
                           "{1} ORDER BY position",
                           columns_of_packet, chosen, most + 1);
    if (!window)
        sql = fmt::format("SELECT {0} FROM atirma.packets WHERE boat = $1 AND position > $2 AND position <= $3 {1} "
                          "ORDER BY position LIMIT {2}",
                          columns_of_packet, chosen, most + 1);
    ask<track_page>(sql,
                    {std::to_string(boat_), std::to_string(bounded(after)), std::to_string(bounded(up_to)),
                     milliseconds(request.from), milliseconds(request.until)},
                    std::move(done), [this, seen = request.seen, most, after, up_to](const postgres_rows& rows) {
                        track_page made;
                        made.packets = packets_in(rows);
                        made.more = made.packets.size() > most;
                        if (made.more) made.packets.pop_back();
                        made.seen = seen;
                        for (const auto& life : lives_.over) made.seen.erase(life.store);
                        auto reached = made.more ? made.packets.back().position : std::max(after, up_to);
                        if (reached != 0) made.seen[number()] = reached;
                        return made;
                    });
}

// --- telecommands and authority ---------------------------------------------------------------------------------

void postgres_store::begin(const command_record& record, std::uint32_t epoch, then<begun> done) {
    const auto& s = record.status;
    auto boat = std::to_string(boat_);
    then<begun> answered = [this, boat, done = std::move(done)](ise::result<begun> made) mutable {
        if (!made || !made->authority) return done(std::move(made));
        // Only its mark came: the state follows.
        ask<begun>(authority_query, {boat}, std::move(done), [this](const postgres_rows& rows) {
            begun outcome;
            outcome.authority = authority_in(rows).value_or(change_of_authority());
            authority_ = {outcome.authority->first.epoch, outcome.authority->second};
            return outcome;
        });
    };
    ask<begun>("SELECT outcome, known FROM atirma.begin_command($1, $2, $3, $4, $5, $6, $7, $8)",
               {boat, std::to_string(epoch), std::to_string(s.id), s.asked_by, std::to_string(weight_of(record)),
                std::to_string(s.at.time_since_epoch().count()), record.node, ise::to_json(record)},
               std::move(answered), [](const postgres_rows& rows) {
                   begun made;
                   if (text_of(rows.at(0), 0) == "known")
                       made.known = ise::from_json<command_record>(text_of(rows[0], 1));
                   if (text_of(rows.at(0), 0) == "other authority") made.authority.emplace();
                   return made;
               });
}

void postgres_store::put(std::vector<command_record> records, then<void> done) {
    command_arrays arrays(records);
    ask<void>("SELECT atirma.put_commands($1, $2, $3, $4, $5, $6, $7, $8)",
              {std::to_string(boat_), arrays.ids, arrays.opens, arrays.askers, arrays.weights, arrays.changes,
               arrays.givers, arrays.contents},
              std::move(done), [](const postgres_rows&) {});
}

void postgres_store::command(std::uint32_t id, then<std::optional<command_record>> done) {
    ask<std::optional<command_record>>("SELECT record FROM atirma.commands WHERE boat = $1 AND id = $2",
                                       {std::to_string(boat_), std::to_string(id)}, std::move(done),
                                       [](const postgres_rows& rows) {
                                           auto found = records_in(rows);
                                           return found.empty() ? std::nullopt : std::optional(std::move(found[0]));
                                       });
}

void postgres_store::list(const record_request& request, then<record_page> done) {
    auto boat = std::to_string(boat_);
    bool first = request.before == 0;
    then<record_page> listed = [this, boat, first, done = std::move(done)](ise::result<record_page> page) mutable {
        if (!page || !first) return done(std::move(page));
        ask<record_page>("SELECT state FROM atirma.authority WHERE boat = $1 ORDER BY epoch DESC LIMIT 20", {boat},
                         std::move(done), [made = std::move(*page)](const postgres_rows& rows) mutable {
                             for (const auto& row : rows)
                                 made.authority.push_back(ise::from_json<authority_state>(text_of(row, 0)));
                             return std::move(made);
                         });
    };
    ask<record_page>(
        fmt::format("SELECT record, number FROM atirma.commands WHERE boat = $1 AND number < $2 AND ($3 = '' OR "
                    "asked_by = $3) ORDER BY number DESC LIMIT {}",
                    request.max_entries + 1),
        {boat, std::to_string(first ? std::numeric_limits<std::int64_t>::max() : bounded(request.before)),
         request.asked_by},
        std::move(listed), [most = request.max_entries](const postgres_rows& rows) {
            record_page made;
            auto count = std::min<std::size_t>(rows.size(), most);
            if (rows.size() > most) made.before = number_of(rows[count - 1], 1);
            for (std::size_t i = 0; i < count; ++i)
                made.entries.push_back(ise::from_json<command_record>(text_of(rows[i], 0)).status);
            return made;
        });
}

void postgres_store::put(const change_of_authority& state, const std::pair<std::uint32_t, std::uint64_t>& before,
                         then<std::optional<change_of_authority>> done) {
    auto boat = std::to_string(boat_);
    std::pair next(state.first.epoch, state.second);
    then<bool> changed = [this, boat, next, done = std::move(done)](ise::result<bool> yes) mutable {
        if (!yes) return done(yes.error());
        if (*yes) {
            authority_ = next;
            return done(std::optional<change_of_authority>());
        }
        ask<std::optional<change_of_authority>>(
            authority_query, {boat}, std::move(done), [](const postgres_rows& rows) {
                return std::optional(authority_in(rows).value_or(change_of_authority()));
            });
    };
    ask<bool>("SELECT atirma.put_authority($1, $2, $3, $4, $5, $6)",
              {boat, std::to_string(before.first), std::to_string(before.second), std::to_string(next.first),
               std::to_string(next.second), ise::to_json(state.first)},
              std::move(changed), [](const postgres_rows& rows) { return text_of(rows.at(0), 0) == "t"; });
}

void postgres_store::tend(std::uint64_t, std::uint64_t keep_commands, then<std::int64_t> done) {
    ask<std::int64_t>("SELECT atirma.prune($1, $2)", {std::to_string(boat_), std::to_string(bounded(keep_commands))},
                      std::move(done), [](const postgres_rows& rows) { return integer_of(rows.at(0), 0); });
}

} // namespace atirma
