// A store that is damaged, or went back in time.
#include <components/communication_node/communication_node.hpp>
#include <components/communication_node/node_core.hpp>
#include <components/communication_node/store_check.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t repair_page = 256;
constexpr ise::duration pause = 1ms; // between pages: the loop serves others meanwhile
constexpr ise::duration try_again = 1s;
constexpr std::uint8_t location_kind = 1; // the type of a location on air

/// What a store says when it is opened.
struct remembered {
    std::vector<std::pair<std::uint8_t, utc_time>> newest;
    std::optional<telemetry_packet> last_location;
    std::pair<authority_state, std::uint64_t> authority;
    std::vector<command_record> open_commands;
};

ise::result<remembered> remember(const std::string& file, std::uint64_t fresh_number,
                                 std::optional<node_store>& store) {
    auto opened = node_store::open(file, fresh_number);
    if (!opened) return opened.error();
    store.emplace(std::move(*opened));
    remembered made;
    auto newest = store->newest();
    if (!newest) return newest.error();
    made.newest = std::move(*newest);
    auto last = store->last_of(location_kind);
    if (!last) return last.error();
    made.last_location = std::move(*last);
    auto authority = store->authority();
    if (!authority) return authority.error();
    made.authority = std::move(*authority);
    auto open = store->open_commands();
    if (!open) return open.error();
    made.open_commands = std::move(*open);
    return made;
}

std::string notice_of(const ise::failure& damage, const std::string& aside) {
    return fmt::format("its store was damaged and set aside as {}: {}", aside, damage.message());
}

} // namespace

/// A disk that is full, or not mounted yet, may be there later; a file of a newer program never is.
ise::task<> communication_node::open_store() {
    std::vector<std::string> aside;
    std::string notice, said;
    for (;;) {
        std::optional<node_store> store;
        auto known = remember(options_.file, env().random(), store);
        if (known) {
            core_ = std::make_unique<node_core>(
                *this, std::move(*store), options_, [this] { work(); }, [this] { tick(); });
            auto& c = *core_;
            c.store_notice = notice;
            c.refilling = !aside.empty();
            c.shown = c.store.head(); // whoever was told of less catches up by `track`
            for (auto& [kind, at] : known->newest) c.newest.know(kind, at);
            if (known->last_location) note_fix(*known->last_location);
            c.authority.apply(known->authority.first, known->authority.second);
            for (const auto& record : known->open_commands) c.desk.know(now(), clock(), record, path());
            break;
        }
        auto why = known.error();
        if (why.code() == ise::errc::malformed) {
            auto moved =
                store ? store->set_aside(why, wall(), log()) : atirma::set_aside(options_.file, why, wall(), log());
            if (moved) {
                notice = notice_of(why, *moved);
                aside.push_back(*moved);
            } else {
                why = ise::failure(ise::errc::io_failed, fmt::format("{}; {}", why.message(), moved.error().message()));
            }
        } else if (why.code() != ise::errc::io_failed) {
            throw ise::error(why);
        }
        if (why.code() == ise::errc::io_failed && why.message() != said)
            log().error("its store cannot be opened; it is tried again every second", {{"cause", why.message()}});
        said = why.message();
        co_await sleep(try_again);
    }
    for (const auto& file : aside) begin_salvage(file);
}

void communication_node::replace_store(const ise::failure& why) {
    auto& c = *core_;
    auto aside = c.store.set_aside(why, wall(), log());
    if (!aside) {
        auto text = fmt::format("{}; {}", why.message(), aside.error().message());
        if (text != c.trouble) log().error("its store is damaged", {{"cause", text}});
        if (auto again = c.store.begin_anew(env().random()); !again) text = again.error().message();
        c.trouble = text;
        consider_serving();
        return;
    }
    c.store_notice = notice_of(why, *aside);
    c.refilling = true;
    begin_store_anew();
    begin_salvage(*aside);
}

/// What is known in memory goes to the new file at once.
void communication_node::begin_store_anew() {
    auto& c = *core_;
    auto begun = c.store.begin_anew(env().random());
    if (!begun) {
        if (c.trouble != begun.error().message())
            log().error("nothing can be kept", {{"cause", begun.error().message()}});
        c.trouble = begun.error().message();
        consider_serving();
        return;
    }
    c.trouble.clear();
    c.shown = 0;
    c.caught_up = options_.peer.empty();
    c.peer.forget();
    for (const auto& status : c.desk.open())
        if (const auto* record = c.desk.find(status.id)) c.unsaved[status.id] = *record;
    if (c.authority.now().epoch != 0) {
        auto put = c.store.put(c.authority.now(), c.authority.change());
        if (!put) disk(&put.error());
    }
    put_changes();
    c.news.notify();
    c.progress.notify();
    consider_serving();
}

void communication_node::begin_salvage(const std::string& file) {
    ++core_->salvaging;
    spawn(fmt::format("reads {}", file), salvage(file));
}

/// What is sound in a store that was set aside comes into the present one: the other node may not have all of it.
ise::task<> communication_node::salvage(std::string file) {
    auto& c = *core_;
    auto opened = store_reader::open(file);
    if (opened) {
        auto& reader = *opened;
        auto held = reader.authority();
        if (c.authority.is_newer(held.first, held.second)) {
            auto put = c.store.put(held.first, held.second);
            if (!put) disk(&put.error());
            c.authority.apply(held.first, held.second);
            c.authorities(held.first);
        }
        for (auto records = reader.next_commands(repair_page); !records.empty();
             records = reader.next_commands(repair_page)) {
            bool kept = take_salvaged(records);
            while (!kept) {
                co_await sleep(try_again);
                kept = take_salvaged(records);
            }
            co_await sleep(pause);
        }
        for (auto packets = reader.next_packets(repair_page); !packets.empty();
             packets = reader.next_packets(repair_page)) {
            bool kept = take_salvaged(packets);
            while (!kept) {
                co_await sleep(try_again);
                kept = take_salvaged(packets);
            }
            co_await sleep(pause);
        }
        const auto& found = reader.found();
        auto outcome = fmt::format("{} packets and {} telecommands of it were sound; {} and {} were not, and {} parts "
                                   "could not be read",
                                   found.packets, found.telecommands, found.damaged_packets, found.damaged_telecommands,
                                   found.unreadable.size());
        c.store_notice += "; " + outcome;
        log().warning("the intact rows of the damaged store are restored", {{"file", file}, {"found", outcome}});
    } else {
        c.store_notice += "; nothing of it can be read";
        log().error("nothing can be read of the store that was set aside", {{"cause", opened.error().message()}});
    }
    --c.salvaging;
    consider_serving();
}

bool communication_node::take_salvaged(const std::vector<command_record>& records) {
    auto& c = *core_;
    auto news = news_among(records);
    if (!news) return false;
    auto put = c.store.put(*news);
    disk(put ? nullptr : &put.error());
    if (!put) return false;
    know_all(*news);
    c.news.notify();
    work();
    return true;
}

bool communication_node::take_salvaged(const std::vector<telemetry_packet>& packets) {
    auto& c = *core_;
    auto kept = c.store.add(packets);
    disk(kept ? nullptr : &kept.error());
    if (!kept) return false;
    c.news.notify();
    show();
    return true;
}

/// The other node knows more of this node's store than there is: `shared` of it is certain.
void communication_node::went_back(const store_part& known_there, const store_part& shared) {
    auto& c = *core_;
    if (shared.packets >= known_there.packets && shared.commands >= known_there.commands) return;
    if (known_there == c.told_back || c.refilling) return;
    c.told_back = known_there;
    auto text =
        fmt::format("the store went back in time, or is another file: '{}' knows {} packets and {} changes of "
                    "telecommands of it, of which {} and {} are here; the nodes send each other what is missing",
                    options_.peer, known_there.packets, known_there.commands, shared.packets, shared.commands);
    c.store_notice = c.store_notice.empty() ? text : c.store_notice + "; " + text;
    log().error("its store went back in time: was a backup restored?", {{"file", c.store.file()}, {"found", text}});
}

} // namespace atirma
