#include <ise/http/sse_channel.hpp>

#include <algorithm>
#include <optional>
#include <utility>

namespace ise {

namespace {
struct sse_client {
    std::shared_ptr<sse_sink> sink;
    std::string queue;              ///< encoded events that wait for the write under way
    std::string queued_id, sent_id; ///< of the last event there, and of the last that was given to the sink
    std::uint64_t queued_events = 0;
    bool writing = false;
    bool needs_snapshot = false;
    bool gone = false;
    bool wrote_since_tick = false;
    unsigned stuck_ticks = 0;
};

void append_field(std::string& out, std::string_view name, std::string_view value) {
    out.append(name).append(": ");
    // A line break would forge another field.
    for (char c : value)
        if (c != '\n' && c != '\r' && c != '\0') out += c;
    out += '\n';
}
} // namespace

std::string encode_event(const sse_event& event) {
    std::string out;
    out.reserve(event.data.size() + event.id.size() + event.name.size() + 32);
    if (!event.id.empty()) append_field(out, "id", event.id);
    if (!event.name.empty()) append_field(out, "event", event.name);
    std::string_view rest = event.data;
    for (;;) {
        auto end = rest.find('\n');
        append_field(out, "data", rest.substr(0, end));
        if (end == std::string_view::npos) break;
        rest.remove_prefix(end + 1);
    }
    return out += '\n';
}

struct sse_channel::implementation : std::enable_shared_from_this<implementation> {
    using client_ptr = std::shared_ptr<sse_client>;

    implementation(snapshot_source source, sse_limits chosen) : snapshot(std::move(source)), limits(chosen) {}

    void write(const client_ptr& client, std::shared_ptr<const std::string> text) {
        client->writing = true;
        client->wrote_since_tick = true;
        client->stuck_ticks = 0;
        // Both weakly: the sink keeps the callback, and the client keeps the sink.
        client->sink->write(std::move(text),
                            [weak = weak_from_this(), weak_client = std::weak_ptr(client)](std::error_code failed) {
                                auto self = weak.lock();
                                auto written = weak_client.lock();
                                if (self && written) self->on_written(written, failed);
                            });
    }

    void on_written(const client_ptr& client, std::error_code failed) {
        client->writing = false;
        if (client->gone) return;
        if (failed) return forget(client, statistics.left);
        if (client->needs_snapshot) {
            client->needs_snapshot = false;
            auto fresh = snapshot(client->sent_id); // with what it lacks only, where the source can tell
            if (!fresh.id.empty()) client->sent_id = fresh.id;
            write(client, std::make_shared<const std::string>(encode_event(fresh)));
        } else if (!client->queue.empty()) {
            client->queued_events = 0;
            if (!client->queued_id.empty()) client->sent_id = std::exchange(client->queued_id, {});
            write(client, std::make_shared<const std::string>(std::exchange(client->queue, {})));
        }
    }

    void enqueue(const client_ptr& client, const std::shared_ptr<const std::string>& text, const std::string& id) {
        if (client->gone) return;
        if (!client->writing) {
            if (!id.empty()) client->sent_id = id;
            return write(client, text);
        }
        if (client->needs_snapshot) { // the snapshot will hold it
            ++statistics.events_skipped;
            return;
        }
        if (client->queue.size() + text->size() > limits.max_queued_bytes) {
            ++statistics.resynchronised;
            statistics.events_skipped += client->queued_events + 1;
            client->queue = {};
            client->queued_id.clear();
            client->queued_events = 0;
            client->needs_snapshot = true;
            return;
        }
        client->queue += *text;
        if (!id.empty()) client->queued_id = id;
        ++client->queued_events;
    }

    void forget(const client_ptr& client, std::uint64_t& counter) {
        if (std::exchange(client->gone, true)) return;
        ++counter;
        clients.erase(std::remove(clients.begin(), clients.end(), client), clients.end());
        client->sink->close();
    }

    /// The snapshot that all share who know nothing of this life of the source; null where this one does.
    std::shared_ptr<const std::string> common_snapshot(std::string_view last_event_id) {
        if (!last_event_id.empty()) {
            if (!common) return nullptr;
            auto life = [](std::string_view id) { return id.substr(0, id.rfind(':')); };
            if (common_id.empty() || life(last_event_id) == life(common_id)) return nullptr;
        }
        if (common) return ++statistics.shared, common;
        auto made = snapshot({});
        common_id = made.id;
        common_at = statistics.published;
        return common = std::make_shared<const std::string>("retry: 2000\n\n" + encode_event(made));
    }

    snapshot_source snapshot;
    sse_limits limits;
    std::shared_ptr<const std::string> common;
    std::string common_id;
    std::uint64_t common_at = 0; ///< `published` when it was made
    sse_statistics statistics;
    std::vector<client_ptr> clients;
    bool closed = false;
};

sse_channel::sse_channel(snapshot_source snapshot, sse_limits limits)
    : self_(std::make_shared<implementation>(std::move(snapshot), limits)) {}

sse_channel::~sse_channel() { close(); }

bool sse_channel::add(std::shared_ptr<sse_sink> sink, std::string_view last_event_id) {
    if (self_->closed || self_->clients.size() >= self_->limits.max_clients) {
        ++self_->statistics.refused;
        return false;
    }
    // Made before the client is known: a source that throws leaves nothing behind.
    auto& self = *self_;
    auto first = self.common_snapshot(last_event_id);
    auto id = self.common_id;
    std::optional<sse_event> since;
    if (!first) {
        auto own = self.snapshot(last_event_id);
        id = own.id;
        first = std::make_shared<const std::string>("retry: 2000\n\n" + encode_event(own));
    } else if (self.statistics.published != self.common_at) {
        since = self.snapshot(id);
    }
    auto client = std::make_shared<sse_client>();
    client->sink = std::move(sink);
    client->sent_id = id;
    self.clients.push_back(client);
    ++self.statistics.accepted;
    self.write(client, std::move(first));
    if (since) self.enqueue(client, std::make_shared<const std::string>(encode_event(*since)), since->id);
    return true;
}

void sse_channel::remove(const sse_sink* sink) noexcept {
    auto known = std::find_if(self_->clients.begin(), self_->clients.end(),
                              [&](const auto& client) { return client->sink.get() == sink; });
    if (known == self_->clients.end()) return;
    auto client = *known;
    self_->forget(client, self_->statistics.left);
}

void sse_channel::publish(const sse_event& event) {
    ++self_->statistics.published;
    if (self_->clients.empty()) return;
    auto text = std::make_shared<const std::string>(encode_event(event));
    auto now = self_->clients; // a sink that fails at once changes the list
    for (const auto& client : now) self_->enqueue(client, text, event.id);
}

std::uint64_t sse_channel::tick() {
    self_->common.reset();
    const auto before = self_->statistics.dropped_slow;
    static const auto comment = std::make_shared<const std::string>(": still here\n\n");
    auto now = self_->clients;
    for (const auto& client : now) {
        if (client->gone) continue;
        if (client->writing) {
            if (++client->stuck_ticks >= self_->limits.max_stuck_ticks)
                self_->forget(client, self_->statistics.dropped_slow);
        } else if (!std::exchange(client->wrote_since_tick, false)) {
            self_->write(client, comment);
            client->wrote_since_tick = false; // a comment each quiet tick
        }
    }
    return self_->statistics.dropped_slow - before;
}

void sse_channel::close() noexcept {
    self_->closed = true;
    auto now = std::exchange(self_->clients, {});
    for (const auto& client : now) {
        client->gone = true;
        client->sink->close();
    }
}

std::size_t sse_channel::clients() const noexcept { return self_->clients.size(); }
const sse_statistics& sse_channel::statistics() const noexcept { return self_->statistics; }

} // namespace ise
