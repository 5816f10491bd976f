#include <components/mqtt_bridge/outgoing_queue.hpp>

#include <algorithm>
#include <array>
#include <utility>

namespace ise::mqtt {
namespace {

constexpr std::size_t overhead = 128; // of a message, beside its bytes
constexpr std::int64_t looked_at_once = 64;

constexpr std::array<std::string_view, 1> scripts = {R"(
CREATE TABLE queue (
    number INTEGER PRIMARY KEY, -- in the order of their publication
    topic TEXT NOT NULL,
    payload BLOB NOT NULL,
    retain INTEGER NOT NULL,
    published INTEGER NOT NULL, -- nanoseconds since 1970
    bytes INTEGER NOT NULL      -- that it counts for
);
CREATE TABLE calls (
    key BLOB PRIMARY KEY,       -- response topic, NUL, correlation data
    digest INTEGER NOT NULL,    -- of topic and request
    life INTEGER NOT NULL,      -- of the process that began it
    began INTEGER NOT NULL,     -- milliseconds since 1970
    code TEXT,                  -- NULL: it has not ended
    execution TEXT,
    payload BLOB
);
CREATE INDEX calls_by_age ON calls (began);
)"};

std::vector<std::byte> bytes_of(const std::string& text) {
    const auto* begin = reinterpret_cast<const std::byte*>(text.data());
    return {begin, begin + text.size()};
}

std::string text_of(const std::vector<std::byte>& raw) {
    return {reinterpret_cast<const char*>(raw.data()), raw.size()};
}

} // namespace

const std::span<const std::string_view> bridge_schema(scripts);

std::size_t outgoing_queue::size_of(const queued_message& one) noexcept {
    return one.topic.size() + one.payload.size() + overhead;
}

result<outgoing_queue> outgoing_queue::open(database& db, queue_limits limits) {
    outgoing_queue made(db, limits);
    auto found = db.query("SELECT count(*), coalesce(sum(bytes), 0), coalesce(max(number), 0) FROM queue");
    if (!found) return found.error();
    const auto& row = found->at(0);
    made.beyond_ = static_cast<std::uint64_t>(row.integer(0));
    made.disk_bytes_ = static_cast<std::uint64_t>(row.integer(1));
    made.last_number_ = static_cast<std::uint64_t>(row.integer(2));
    return made;
}

std::uint64_t outgoing_queue::take_number(wall_time wall) {
    auto now = std::chrono::duration_cast<std::chrono::microseconds>(wall.time_since_epoch()).count();
    // An earlier life took its numbers from its own time, and none that is on disk is taken again.
    last_number_ = std::max(last_number_ + 1, static_cast<std::uint64_t>(std::max<std::int64_t>(now, 0)));
    return last_number_;
}

void outgoing_queue::put_ready(entry one) {
    ready_until_ = std::max(ready_until_, one.what.number);
    ready_.push_back(std::move(one));
}

void outgoing_queue::push(queued_message what, time_point now, wall_time wall) {
    if (memory_bytes_ + size_of(what) > limits_.memory_bytes) {
        ++dropped_;
        return;
    }
    memory_bytes_ += size_of(what);
    entry made;
    made.what = std::move(what);
    made.what.number = take_number(wall);
    made.came = now;
    if (beyond_ == 0 && fresh_.empty() && ready_.size() < limits_.window) put_ready(std::move(made));
    else fresh_.push_back(std::move(made));
}

void outgoing_queue::refill() {
    if (beyond_ > 0 && 2 * ready_.size() <= limits_.window) {
        auto rows = db_->query("SELECT number, topic, payload, retain, published FROM queue WHERE number > ? ORDER BY "
                               "number LIMIT ?",
                               {static_cast<std::int64_t>(ready_until_), static_cast<std::int64_t>(limits_.window)});
        if (!rows) return; // the next call tries again, and `store` reports it
        for (const auto& row : *rows) {
            entry made;
            made.what.number = static_cast<std::uint64_t>(row.integer(0));
            made.what.topic = row.text(1);
            made.what.payload = text_of(row.bytes(2));
            made.what.retain = row.integer(3) != 0;
            made.what.published = wall_time(std::chrono::nanoseconds(row.integer(4)));
            made.on_disk = made.from_disk = true;
            put_ready(std::move(made));
        }
        beyond_ -= std::min<std::uint64_t>(beyond_, rows->size());
        if (rows->size() < limits_.window) beyond_ = 0; // a damaged file may have had fewer than it counted
    }
    while (beyond_ == 0 && !fresh_.empty() && ready_.size() < limits_.window) {
        put_ready(std::move(fresh_.front()));
        fresh_.pop_front();
    }
}

const outgoing_queue::entry* outgoing_queue::next() {
    refill();
    if (in_flight_ >= limits_.window) return nullptr;
    auto found = std::ranges::find_if(ready_, [](const auto& one) { return !one.sent; });
    return found == ready_.end() ? nullptr : &*found;
}

outgoing_queue::entries::iterator outgoing_queue::find(std::uint64_t number) noexcept {
    auto found = std::ranges::lower_bound(ready_, number, {}, [](const auto& one) { return one.what.number; });
    return found != ready_.end() && found->what.number == number ? found : ready_.end();
}

void outgoing_queue::sent(std::uint64_t number) {
    auto found = find(number);
    if (found == ready_.end() || std::exchange(found->sent, true)) return;
    ++in_flight_;
}

void outgoing_queue::done(std::uint64_t number) {
    auto found = find(number);
    if (found == ready_.end()) return;
    if (found->sent) --in_flight_;
    if (found->on_disk) {
        confirmed_.push_back(number);
        confirmed_bytes_ += size_of(found->what);
    } else {
        memory_bytes_ -= size_of(found->what);
    }
    ready_.erase(found);
}

void outgoing_queue::again(std::uint64_t number) {
    auto found = find(number);
    if (found == ready_.end() || !std::exchange(found->sent, false)) return;
    --in_flight_;
}

void outgoing_queue::lost() {
    for (auto& one : ready_)
        if (std::exchange(one.sent, false)) one.sent_before = true;
    in_flight_ = 0;
}

// A row was deleted to make room.
void outgoing_queue::drop(std::uint64_t number, std::uint64_t bytes) {
    disk_bytes_ -= std::min(disk_bytes_, bytes);
    auto found = find(number);
    if (found != ready_.end() && found->sent) { // it is on its way
        found->on_disk = false;
        memory_bytes_ += size_of(found->what);
        return;
    }
    ++dropped_;
    if (found != ready_.end()) ready_.erase(found);
    else if (number > ready_until_ && beyond_ > 0) --beyond_;
}

result<void> outgoing_queue::store(time_point older_than) {
    std::vector<entry*> added;
    std::uint64_t added_bytes = 0;
    std::size_t of_fresh = 0;
    for (auto* all : {&ready_, &fresh_})
        for (auto& one : *all) {
            if (one.on_disk) continue;
            if (one.came > older_than) break;
            added.push_back(&one);
            added_bytes += size_of(one.what);
            if (all == &fresh_) ++of_fresh;
        }
    if (added.empty() && confirmed_.empty()) return {};
    struct row {
        std::uint64_t number, bytes;
    };
    std::vector<row> dropped;
    auto write = [&]() -> result<void> {
        for (auto number : confirmed_)
            if (auto done = db_->execute("DELETE FROM queue WHERE number = ?", {static_cast<std::int64_t>(number)});
                !done)
                return done.error();
        auto held = disk_bytes_ - std::min(disk_bytes_, confirmed_bytes_);
        while (held > 0 && held + added_bytes > limits_.disk_bytes) {
            auto oldest = db_->query("SELECT number, bytes FROM queue ORDER BY number LIMIT ?", {looked_at_once});
            if (!oldest) return oldest.error();
            if (oldest->empty()) break;
            for (const auto& one : *oldest) {
                if (held + added_bytes <= limits_.disk_bytes) break;
                auto done = db_->execute("DELETE FROM queue WHERE number = ?", {one.integer(0)});
                if (!done) return done.error();
                row gone{static_cast<std::uint64_t>(one.integer(0)), static_cast<std::uint64_t>(one.integer(1))};
                held -= std::min(held, gone.bytes);
                dropped.push_back(gone);
            }
        }
        for (const auto* one : added) {
            const auto& what = one->what;
            auto at = std::chrono::duration_cast<std::chrono::nanoseconds>(what.published.time_since_epoch()).count();
            auto done = db_->execute("INSERT OR REPLACE INTO queue VALUES (?, ?, ?, ?, ?, ?)",
                                     {static_cast<std::int64_t>(what.number), what.topic, bytes_of(what.payload),
                                      std::int64_t{what.retain}, static_cast<std::int64_t>(at),
                                      static_cast<std::int64_t>(size_of(what))});
            if (!done) return done.error();
        }
        return {};
    };
    if (auto done = db_->transaction(write); !done) return done;
    disk_bytes_ -= std::min(disk_bytes_, confirmed_bytes_);
    confirmed_.clear();
    confirmed_bytes_ = 0;
    disk_bytes_ += added_bytes;
    memory_bytes_ -= static_cast<std::size_t>(added_bytes);
    for (auto* one : added) one->on_disk = true;
    beyond_ += of_fresh;
    fresh_.erase(fresh_.begin(), fresh_.begin() + static_cast<std::ptrdiff_t>(of_fresh));
    for (const auto& one : dropped) drop(one.number, one.bytes);
    return {};
}

} // namespace ise::mqtt
