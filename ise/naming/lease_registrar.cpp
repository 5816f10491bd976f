#include <ise/naming/lease_registrar.hpp>

#include <ise/core/sleep.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/service/back_off.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <unordered_set>

namespace ise {
namespace {

using naming::verdict;

constexpr std::size_t max_batch = 256; // names told in one request
constexpr duration min_patience = std::chrono::milliseconds(200);
constexpr duration max_pause = std::chrono::milliseconds(500);

} // namespace

lease_registrar::lease_registrar(service_host& host, const std::vector<endpoint>& name_servers, duration lease)
    : host_(host), servers_(text_of(name_servers)), lease_(std::max(lease, duration(std::chrono::milliseconds(50)))),
      lease_key_(host.env().random() | 1), batch_size_(max_batch), told_departures_(host.on()), news_(host.on()) {
    auto way = host_.link_to(name_servers, std::string(naming::server_path));
    way->hurry(std::min(lease_ / 4, max_pause), std::max(lease_ / 2, min_patience));
    names_ = remote(std::move(way));
    host_.scope().spawn("names", keep(*this));
}

lease_registrar::~lease_registrar() = default;

bool lease_registrar::confirmed() const noexcept { return host_.env().now() < valid_until_.load(); }

std::uint64_t lease_registrar::epoch_of(const std::string& path) const noexcept {
    auto found = holdings_.find(path);
    return found == holdings_.end() ? 0 : found->second->epoch;
}

// --- what the node asks -------------------------------------------------------------------------------------------

task<result<std::uint64_t>> lease_registrar::enroll(registration who, duration deadline) {
    auto path = who.path;
    auto& on = host_.on();
    auto until = saturating_add(on.now(), deadline);
    forget_departure(path); // the same node's next life replaces the last one
    take_out(path);
    auto* mine = holdings_.emplace(path, std::make_unique<held_name>(on, std::move(who))).first->second.get();
    line_up(*mine);
    wake();

    timer late(on, [mine] { mine->answered.resume(); });
    late.arm(until);
    while (mine->epoch == 0 && !mine->refused && on.now() < until) {
        co_await mine->answered.wait();
        // Withdrawn meanwhile: it is not there any more.
        auto found = holdings_.find(path);
        if (found == holdings_.end() || found->second.get() != mine) {
            late.disarm();
            co_return failure(errc::cancelled, fmt::format("'{}' was withdrawn before it was granted", path));
        }
    }
    if (mine->epoch != 0) co_return mine->epoch;
    if (mine->refused) {
        auto why = *mine->refused;
        take_out(path);
        co_return why;
    }
    const auto& why = mine->obstacle.empty() ? obstacle_ : mine->obstacle;
    co_return failure(errc::name_server_lost, fmt::format("'{}' is not registered yet, it goes on trying: {}", path,
                                                          why.empty() ? "no answer yet" : why));
}

void lease_registrar::update(registration who) {
    auto* name = find(who.path, who.incarnation);
    if (!name) return;
    name->who = std::move(who);
    ++name->version;
    line_up(*name);
    wake();
}

void lease_registrar::set_state(const std::string& path, std::uint64_t incarnation, std::string_view state) {
    auto* name = find(path, incarnation);
    if (!name || name->who.state == state) return;
    name->who.state = state;
    ++name->version;
    line_up(*name);
    wake();
}

task<> lease_registrar::withdraw(std::string path, std::uint64_t incarnation) {
    if (!find(path, incarnation)) co_return;
    auto gone = take_out(path);
    gone->answered.resume();
    leave(path, incarnation);
    // Where many leave at once, one at a time tells of as many as a request holds.
    const auto tried = departures_tried_;
    while (leaves(path, incarnation) && departures_failed_ <= tried) {
        if (telling_departures_) {
            co_await departures_.at(path).over.wait();
        } else {
            co_await tell_departures();
        }
    }
    wake();
}

task<> lease_registrar::farewell() {
    const auto tried = departures_tried_;
    while (!departures_.empty() && confirmed() && departures_failed_ <= tried) {
        if (telling_departures_) {
            co_await told_departures_.wait();
        } else {
            co_await tell_departures();
        }
    }
}

void lease_registrar::leave(const std::string& path, std::uint64_t incarnation) {
    forget_departure(path);
    departures_.try_emplace(path, host_.on(), incarnation);
}

void lease_registrar::forget_departure(const std::string& path) {
    auto known = departures_.find(path);
    if (known == departures_.end()) return;
    known->second.over.resume();
    departures_.erase(known);
}

bool lease_registrar::leaves(const std::string& path, std::uint64_t incarnation) const noexcept {
    auto known = departures_.find(path);
    return known != departures_.end() && known->second.incarnation == incarnation;
}

// --- the coroutine that keeps the lease ---------------------------------------------------------------------------

task<> lease_registrar::keep(lease_registrar& self) {
    back_off pause(self.host_.env(), std::chrono::milliseconds(50), std::min(self.lease_ / 4, max_pause));
    while (!self.host_.scope().stopping()) {
        auto now = self.host_.on().now();
        bool reached = true;
        bool ages = !self.holdings_.empty() && self.renew_at_ <= now; // departures do not renew the lease
        if (!self.departures_.empty() && !self.telling_departures_ && !ages) {
            reached = co_await self.tell_departures();
        } else if (self.due(now)) {
            reached = co_await self.tell();
        } else if (ages) {
            reached = co_await self.renew();
        } else {
            co_await self.pause_until(self.next_event());
        }
        if (reached) {
            pause.reset();
        } else {
            co_await sleep_for(self.host_.on(), pause.next());
        }
    }
}

time_point lease_registrar::next_event() const {
    auto at = holdings_.empty() ? time_point::max() : renew_at_;
    return to_tell_.empty() ? at : std::min(at, to_tell_.begin()->first.first);
}

task<> lease_registrar::pause_until(time_point at) {
    timer due(host_.on(), [this] { wake(); });
    if (at != time_point::max()) due.arm(at);
    if (!has_news_) co_await news_.wait();
    has_news_ = false;
}

void lease_registrar::wake() {
    has_news_ = true;
    news_.resume();
}

void lease_registrar::line_up(held_name& name) {
    if (name.waits_at && name.to_tell() && name.waits_at->first >= name.not_before) return; // it keeps its place
    if (name.waits_at) to_tell_.erase(*name.waits_at);
    name.waits_at.reset();
    if (!name.to_tell()) return;
    name.waits_at.emplace(std::max(name.not_before, host_.on().now()), ++lined_up_);
    to_tell_.emplace(*name.waits_at, &name);
}

held_name* lease_registrar::find(const std::string& path, std::uint64_t incarnation) const noexcept {
    auto found = holdings_.find(path);
    return found != holdings_.end() && found->second->who.incarnation == incarnation ? found->second.get() : nullptr;
}

std::unique_ptr<held_name> lease_registrar::take_out(const std::string& path) {
    auto found = holdings_.find(path);
    if (found == holdings_.end()) return nullptr;
    auto gone = std::move(found->second);
    holdings_.erase(found);
    if (gone->waits_at) to_tell_.erase(*gone->waits_at);
    return gone;
}

std::vector<held_name*> lease_registrar::next_batch() const {
    auto now = host_.on().now();
    std::vector<held_name*> batch;
    for (const auto& [place, name] : to_tell_) {
        if (place.first > now || batch.size() == batch_size_) break;
        batch.push_back(name);
    }
    return batch;
}

naming::register_request lease_registrar::request_of(const std::vector<held_name*>& batch) const {
    const auto& here = host_.env().identity();
    naming::register_request request;
    request.node.lease_key = lease_key_;
    request.node.name = host_.log().component();
    request.node.host_name = here.host_name;
    request.node.host_key = here.host_key;
    request.node.process_key = here.process_key;
    request.node.process_id = here.process_id;
    request.node.launch_mark = host_.env().variable(naming::launch_mark_variable).value_or("");
    request.lease = lease_;
    std::unordered_set<std::uint64_t> result;
    for (const auto* name : batch) {
        request.components.push_back(name->claim());
        for (const auto& service : name->who.services) {
            if (!service.types) continue;
            for (const auto& packet : service.types->schemas) {
                if (!result.insert(packet.fingerprint()).second) continue;
                naming::schema_text text;
                text.fingerprint = packet.fingerprint();
                text.text = packet.text();
                request.schemas.push_back(std::move(text));
            }
        }
    }
    return request;
}

task<bool> lease_registrar::tell() {
    auto batch = next_batch();
    auto request = request_of(batch);
    for (auto* name : batch) name->sent = name->version;
    auto sent_at = host_.on().now();
    auto answer = co_await names_.try_call(naming::enroll, std::move(request),
                                           std::max(lease_, duration(std::chrono::seconds(1))));
    if (!answer) {
        if (answer.error().code() == errc::timed_out) batch_size_ = std::max<std::size_t>(batch_size_ / 2, 1);
        unreachable(answer.error());
        co_return false;
    }
    // Twice as many still arrive within the lease, also where it is the bytes that take so long.
    if (host_.on().now() - sent_at < lease_ / 4) batch_size_ = std::min(batch_size_ * 2, max_batch);
    lease_granted(sent_at, answer->lease);
    look_at_lease(answer->server_incarnation, answer->lease_number);
    for (auto& grant : answer->grants) {
        auto found = holdings_.find(grant.path);
        // It may have been withdrawn meanwhile, or be another life's.
        if (found == holdings_.end() || found->second->sent == 0) continue;
        auto sent = std::exchange(found->second->sent, 0);
        if (grant.what == verdict::granted) found->second->registered = sent;
        take(std::move(grant));
    }
    co_return true;
}

void lease_registrar::take(naming::grant answer) {
    auto& name = *holdings_.at(answer.path);
    bool waited = !name.obstacle.empty();
    auto taken = name.take(answer, host_.on().now(), lease_, lease_known_.first);
    if (!taken) {
        give_up(answer.path, taken.error());
        return;
    }
    line_up(name);
    if (answer.what == verdict::granted && !answer.reason.empty())
        host_.log().warning("the name server has an objection", {{"component", answer.path}, {"cause", answer.reason}});
    if (answer.what == verdict::wait && !waited && !name.answered.waiting())
        host_.log().warning("the name server does not register this component yet; retrying",
                            {{"component", answer.path}, {"cause", answer.reason}});
    // What the server knows nothing of under this lease may go to another meanwhile.
    auto valid = name.registered == 0 ? 0 : name.epoch;
    if (std::exchange(name.shown, valid) == valid) return;
    if (name.answered.waiting()) {
        name.answered.resume();
    } else if (on_change) {
        on_change(name.who, valid);
    }
}

// A name that was denied, or lost: whoever waits for it hears of it, else the node.
void lease_registrar::give_up(const std::string& path, failure why) {
    auto& name = *holdings_.at(path);
    if (name.answered.waiting()) {
        name.refused = std::move(why);
        line_up(name);
        name.answered.resume(); // which removes it
        return;
    }
    auto lost = take_out(path);
    leave(path, lost->who.incarnation); // so that the server does not tell of it again
    wake();
    if (on_change) on_change(lost->who, std::move(why));
}

task<bool> lease_registrar::renew() {
    naming::renew_request request;
    request.lease_key = lease_key_;
    auto sent_at = host_.on().now();
    auto answer = co_await names_.try_call(naming::renew, request, std::max(lease_ / 3, min_patience));
    if (!answer) {
        unreachable(answer.error());
        co_return false;
    }
    if (!answer->known) {
        lease_lost();
        co_return true;
    }
    lease_granted(sent_at, answer->lease);
    look_at_lease(answer->server_incarnation, answer->lease_number);
    for (auto& grant : answer->lost)
        if (holdings_.contains(grant.path) && grant.what == verdict::superseded) take(std::move(grant));
    co_return true;
}

// One request at a time.
task<bool> lease_registrar::tell_departures() {
    telling_departures_ = true;
    const auto number = ++departures_tried_;
    std::vector<naming::departure> result;
    std::optional<failure> why;
    try {
        for (const auto& [path, gone] : departures_) {
            naming::departure made;
            made.path = path;
            made.incarnation = gone.incarnation;
            result.push_back(std::move(made));
            if (result.size() == max_batch) break;
        }
        naming::withdraw_request request;
        request.lease_key = lease_key_;
        request.departures = result;
        auto answer =
            co_await names_.try_call(naming::withdraw, std::move(request), std::max(lease_ / 3, min_patience));
        if (!answer) why = answer.error();
    } catch (...) { // what it would have told comes with the next try
        end_of_telling();
        throw;
    }
    if (why) {
        departures_failed_ = number;
        for (auto& [path, gone] : departures_) gone.over.resume();
        unreachable(*why);
    } else {
        for (const auto& gone : result)
            if (leaves(gone.path, gone.incarnation)) forget_departure(gone.path);
    }
    end_of_telling();
    co_return !why;
}

void lease_registrar::end_of_telling() {
    telling_departures_ = false;
    told_departures_.resume();
    if (!departures_.empty()) departures_.begin()->second.over.resume(); // its turn to tell
    wake();
}

void lease_registrar::lease_granted(time_point sent_at, duration length) {
    bool granted = length > duration{}; // else it has no room for this node now
    if (granted) lease_ = length;
    valid_until_ = granted ? saturating_add(sent_at, lease_) : time_point::min();
    renew_at_ = granted ? saturating_add(sent_at, lease_ / 3) : time_point::max();
    obstacle_.clear();
    if (std::exchange(complained_, false)) host_.log().info("the name server is back", {{"name_server", servers_}});
}

// Where the last lease was over when something was told, that made another one: the server has forgotten all else. Its
// answer need not have arrived, so every answer says which lease it is about.
void lease_registrar::look_at_lease(std::uint64_t server, std::uint64_t number) {
    auto before = std::exchange(lease_known_, std::pair(server, number));
    if (before != lease_known_) tell_again_all();
}

void lease_registrar::tell_again_all() {
    for (auto& [path, name] : holdings_) {
        name->registered = 0;
        line_up(*name);
    }
}

// It was restarted, or we were away for too long: everything is told again, with the epochs that were granted.
void lease_registrar::lease_lost() {
    host_.log().info("the name server does not know this node any more: registering again",
                     {{"name_server", servers_}});
    valid_until_ = time_point::min();
    renew_at_ = time_point::max();
    tell_again_all();
    while (!departures_.empty()) forget_departure(departures_.begin()->first);
}

void lease_registrar::unreachable(const failure& why) {
    if (why.code() == errc::timed_out || why.code() == errc::refused) names_.way().try_next(why);
    obstacle_ = fmt::format("the name server at {} does not answer: {}", servers_, why.message());
    if (confirmed() || host_.scope().stopping() || std::exchange(complained_, true)) return;
    bool holds = std::ranges::any_of(holdings_, [](const auto& entry) { return entry.second->epoch != 0; });
    host_.log().warning(holds
                            ? "names are unconfirmed: they could not be renewed in time, sessions go on"
                            : "the name server is not reached; retrying: is ise_name_server running there, with these "
                              "credentials, and does ISE_NAME_SERVER say where?",
                        {{"name_server", servers_}, {"cause", why.message()}});
}

} // namespace ise
