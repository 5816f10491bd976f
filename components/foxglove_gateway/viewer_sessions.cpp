#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <components/foxglove_gateway/origins.hpp>

#include <ise/core/readable.hpp>

#include <fmt/format.h>

#include <chrono>
#include <iterator>

namespace ise::foxglove {
namespace {

constexpr duration status_period = std::chrono::seconds(5); // between reports of skipped messages
constexpr std::size_t max_operations = 1024;                // of all viewers

http_response refusal(int status, std::string why) {
    http_response made;
    made.status = status;
    made.body = std::move(why) + "\n";
    return made;
}

} // namespace

http_response viewer_sessions::admit(const http_request& asked) {
    const auto& options = in_->options;
    auto origin = std::string(asked.message.header("origin"));
    if (!is_allowed_origin(origin, options.origins)) {
        ++in_->counts.refused;
        in_->note(fmt::format("a page of {} may not connect; allow it with --origin", readable(origin)));
        return refusal(403, fmt::format("Pages of {} may not connect to this gateway (--origin).", origin));
    }
    if (all_.size() >= options.max_viewers) {
        ++in_->counts.refused;
        in_->note(fmt::format("{} viewers are connected: another one is refused (max-viewers)", all_.size()));
        return refusal(503, "Too many viewers are connected (max-viewers). Try again later.");
    }
    auto talking = [me = shared_from_this(), peer = asked.peer](std::shared_ptr<web_socket> over) {
        return talk(me, std::move(over), peer);
    };
    auto made = accept_web_socket(asked, {std::begin(subprotocols), std::end(subprotocols)}, talking);
    if (made.status != 101) ++in_->counts.refused;
    return made;
}

task<> viewer_sessions::talk(std::shared_ptr<viewer_sessions> me, std::shared_ptr<web_socket> over, std::string peer) {
    auto wake = [weak = std::weak_ptr(over)] {
        if (auto there = weak.lock()) there->wake();
    };
    auto who = std::make_shared<viewer>(me->in_->options.viewer, wake);
    struct leaving {
        viewer_sessions& of;
        viewer& mine;
        ~leaving() { of.leave(mine); }
    } guard{*me, *who};
    auto& entry = me->all_[who.get()];
    entry.who = who;
    entry.over = over;
    entry.peer = peer;
    ++me->in_->counts.accepted;
    over->on_room([who](std::string& to) { who->fill(to); });
    me->on_.joined(*who);
    for (;;) {
        auto got = co_await over->next();
        if (!got) break;
        const bool text = got->kind == web_socket_opcode::text;
        auto read = text ? read_text(got->payload) : read_binary(got->payload);
        if (read) {
            me->on_.received(who, *read);
        } else {
            ++me->in_->counts.malformed;
            refuse(*who, read.error().message());
        }
        me->check(*who);
    }
}

void viewer_sessions::leave(viewer& who) {
    who.gone = true;
    in_->counts.messages += who.sent();
    in_->counts.skipped += who.skipped();
    on_.left(who);
    all_.erase(&who);
}

// A viewer that does not read what it asked for is disconnected: that cannot be skipped.
void viewer_sessions::check(viewer& who) {
    if (!who.overrun()) return;
    auto found = all_.find(&who);
    auto over = found == all_.end() ? nullptr : found->second.over.lock();
    if (!over || over->over()) return;
    ++in_->counts.disconnected;
    over->close(web_socket_code::policy,
                fmt::format("more than {} bytes were not read (max_control_bytes)", who.limits().max_control_bytes));
}

void viewer_sessions::tell_all(std::string message) {
    auto shared = std::make_shared<const std::string>(std::move(message));
    for (auto& [raw, one] : all_) one.who->text(shared);
}

void viewer_sessions::refuse(viewer& who, std::string_view why) { who.text(write_status(status_level::error, why)); }

std::optional<viewer_sessions::operation> viewer_sessions::begin(const std::shared_ptr<viewer>& who) {
    if (who->operations >= who->limits().max_operations || operations_ >= max_operations) return std::nullopt;
    return operation(shared_from_this(), who);
}

std::string viewer_sessions::too_much(const viewer& who) {
    return fmt::format("{} requests are being answered: try again later (max_operations)", who.operations);
}

viewer_sessions::operation::operation(std::shared_ptr<viewer_sessions> in, std::shared_ptr<viewer> who)
    : in_(std::move(in)), who_(std::move(who)) {
    ++who_->operations;
    ++in_->operations_;
}

viewer_sessions::operation::~operation() {
    if (!in_) return; // moved
    --who_->operations;
    --in_->operations_;
    in_->check(*who_);
}

void viewer_sessions::tick() {
    const auto now = in_->self.now();
    for (auto& [raw, one] : all_) {
        auto& who = *one.who;
        check(who);
        if (who.skipped() == who.told_skipped || now - one.told_at < status_period) continue;
        who.text(write_status(status_level::warning,
                              fmt::format("{} messages were skipped as this viewer does not take them in time; the "
                                          "newest of each channel are sent",
                                          who.skipped() - who.told_skipped)));
        who.told_skipped = who.skipped();
        one.told_at = now;
    }
}

void viewer_sessions::count_into(gateway_status& to) const {
    to.viewers = static_cast<std::uint32_t>(all_.size());
    for (const auto& [raw, one] : all_) {
        to.messages += one.who->sent();
        to.skipped += one.who->skipped();
    }
}

} // namespace ise::foxglove
