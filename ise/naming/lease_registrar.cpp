#include <ise/naming/lease_registrar.hpp>

#include <ise/core/sleep.hpp>
#include <ise/service/back_off.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <unordered_set>

namespace ise {
namespace {

using naming::verdict;

constexpr std::size_t batch_size = 256; // names told in one request
constexpr duration min_patience = std::chrono::milliseconds(200);
constexpr duration max_pause = std::chrono::milliseconds(500);

} // namespace

lease_registrar::lease_registrar(service_host& host, endpoint name_server, duration lease)
    : host_(host), server_(std::move(name_server)), lease_(std::max(lease, duration(std::chrono::milliseconds(50)))),
      lease_key_(host.env().random() | 1), news_(host.on(), [this] { news_.resume(); }) {
    auto way = host_.link_to(server_, std::string(naming::server_path));
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
    departures_.erase(path); // the same node's next life replaces the last one
    auto& entry = holdings_[path];
    entry = std::make_unique<held_name>(on, std::move(who));
    auto* mine = entry.get();
    mine->enrolling = true;
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
    mine->enrolling = false;
    if (mine->epoch != 0) co_return mine->epoch;
    if (mine->refused) {
        auto why = *mine->refused;
        holdings_.erase(path);
        co_return why;
    }
    const auto& why = mine->obstacle.empty() ? obstacle_ : mine->obstacle;
    co_return failure(errc::name_server_lost, fmt::format("'{}' is not registered yet, it goes on trying: {}", path,
                                                          why.empty() ? "no answer yet" : why));
}

void lease_registrar::update(registration who) {
    auto found = holdings_.find(who.path);
    if (found == holdings_.end() || found->second->who.incarnation != who.incarnation) return;
    found->second->who = std::move(who);
    ++found->second->version;
    wake();
}

void lease_registrar::set_state(const std::string& path, std::string_view state) {
    auto found = holdings_.find(path);
    if (found == holdings_.end() || found->second->who.state == state) return;
    found->second->who.state = state;
    ++found->second->version;
    wake();
}

task<> lease_registrar::withdraw(std::string path) {
    auto found = holdings_.find(path);
    if (found == holdings_.end()) co_return;
    auto incarnation = found->second->who.incarnation;
    auto gone = std::move(found->second);
    holdings_.erase(found);
    gone->answered.resume();
    departures_[path] = incarnation;
    // Where many leave at once, each would tell of all: one does, and the others wait for it.
    const auto tried = departures_tried_;
    while (leaves(path, incarnation) && departures_failed_ <= tried) co_await tell_departures();
    wake();
}

task<> lease_registrar::farewell() {
    const auto tried = departures_tried_;
    while (!departures_.empty() && confirmed() && departures_failed_ <= tried) co_await tell_departures();
}

bool lease_registrar::leaves(const std::string& path, std::uint64_t incarnation) const noexcept {
    auto known = departures_.find(path);
    return known != departures_.end() && known->second == incarnation;
}

// --- the coroutine that keeps the lease ---------------------------------------------------------------------------

task<> lease_registrar::keep(lease_registrar& self) {
    back_off pause(self.host_.env(), std::chrono::milliseconds(50), std::min(self.lease_ / 4, max_pause));
    while (!self.host_.scope().stopping()) {
        auto now = self.host_.on().now();
        bool reached = true;
        if (!self.departures_.empty()) {
            reached = co_await self.tell_departures();
        } else if (!self.next_batch().empty()) {
            reached = co_await self.tell();
        } else if (!self.holdings_.empty() && self.renew_at_ <= now) {
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
    for (const auto& [path, name] : holdings_)
        if (name->told != name->version && !name->refused) at = std::min(at, name->not_before);
    return at;
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

std::vector<held_name*> lease_registrar::next_batch() {
    auto now = host_.on().now();
    std::vector<held_name*> batch;
    for (auto& [path, name] : holdings_) {
        if (!name->due(now)) continue;
        batch.push_back(name.get());
        if (batch.size() == batch_size) break;
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
    std::unordered_set<std::uint64_t> told;
    for (const auto* name : batch) {
        request.components.push_back(name->claim());
        for (const auto& service : name->who.services) {
            if (!service.types) continue;
            for (const auto& packet : service.types->schemas) {
                if (!told.insert(packet.fingerprint()).second) continue;
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
    struct told_state {
        std::uint64_t incarnation;
        std::uint64_t version;
    };
    std::map<std::string, told_state> told;
    for (const auto* name : batch) told.emplace(name->who.path, told_state{name->who.incarnation, name->version});
    auto sent_at = host_.on().now();
    auto answer = co_await names_.try_call(naming::enroll, std::move(request),
                                           std::max(lease_, duration(std::chrono::seconds(1))));
    if (!answer) {
        unreachable(answer.error());
        co_return false;
    }
    lease_granted(sent_at, answer->lease);
    look_at_lease(answer->server_incarnation, answer->lease_number);
    for (auto& grant : answer->grants) {
        auto found = holdings_.find(grant.path);
        auto of = told.find(grant.path);
        // It may have been withdrawn meanwhile, or be another life's.
        if (found == holdings_.end() || of == told.end() || found->second->who.incarnation != of->second.incarnation)
            continue;
        if (grant.what == verdict::granted) found->second->told = of->second.version;
        take(std::move(grant));
    }
    co_return true;
}

void lease_registrar::take(naming::grant answer) {
    auto& name = *holdings_.at(answer.path);
    bool waited = !name.obstacle.empty();
    auto taken = name.take(answer, host_.on().now(), lease_);
    if (!taken) {
        give_up(answer.path, taken.error());
        return;
    }
    if (answer.what == verdict::granted && !answer.reason.empty())
        host_.log().warning("the name server has an objection", {{"component", answer.path}, {"cause", answer.reason}});
    if (answer.what == verdict::wait && !waited && !name.enrolling)
        host_.log().warning("the name server does not register this component yet, trying on",
                            {{"component", answer.path}, {"cause", answer.reason}});
    // What the server knows nothing of under this lease may go to another meanwhile.
    auto valid = name.told == 0 ? 0 : name.epoch;
    if (std::exchange(name.shown, valid) == valid) return;
    if (name.enrolling) {
        name.answered.resume();
    } else if (on_change) {
        on_change(name.who.path, valid);
    }
}

// A name that was denied, or lost: whoever waits for it hears of it, else the node.
void lease_registrar::give_up(const std::string& path, failure why) {
    auto found = holdings_.find(path);
    auto& name = *found->second;
    if (name.enrolling) {
        name.refused = std::move(why);
        name.answered.resume(); // which removes it
        return;
    }
    auto lost = std::move(found->second);
    holdings_.erase(found);
    departures_[path] = lost->who.incarnation; // so that the server does not tell of it again
    wake();
    if (on_change) on_change(path, std::move(why));
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

// One at a time; who comes meanwhile waits for its end, and is told how it went.
task<bool> lease_registrar::tell_departures() {
    if (telling_departures_) {
        const auto awaited = departures_tried_; // the next may have begun when this goes on
        waiter<> told(host_.on(), [&told] { told.resume(); });
        await_departures_.push_back(&told);
        co_await told.wait();
        std::erase(await_departures_, &told);
        co_return departures_failed_ < awaited;
    }
    telling_departures_ = true;
    auto end = [this] {
        telling_departures_ = false;
        for (auto* other : await_departures_) other->resume();
    };
    const auto number = ++departures_tried_;
    std::vector<naming::departure> told;
    std::optional<failure> why;
    try {
        for (const auto& [path, incarnation] : departures_) {
            naming::departure gone;
            gone.path = path;
            gone.incarnation = incarnation;
            told.push_back(std::move(gone));
            if (told.size() == batch_size) break;
        }
        naming::withdraw_request request;
        request.lease_key = lease_key_;
        request.departures = told;
        auto answer =
            co_await names_.try_call(naming::withdraw, std::move(request), std::max(lease_ / 3, min_patience));
        if (!answer) why = answer.error();
    } catch (...) { // what it would have told comes with the next try
        end();
        throw;
    }
    end();
    if (why) {
        departures_failed_ = number;
        unreachable(*why);
        co_return false;
    }
    for (const auto& gone : told)
        if (leaves(gone.path, gone.incarnation)) departures_.erase(gone.path);
    co_return true;
}

void lease_registrar::lease_granted(time_point sent_at, duration length) {
    bool granted = length > duration{}; // else it has no room for this node now
    if (granted) lease_ = length;
    valid_until_ = granted ? saturating_add(sent_at, lease_) : time_point::min();
    renew_at_ = granted ? saturating_add(sent_at, lease_ / 3) : time_point::max();
    obstacle_.clear();
    if (std::exchange(complained_, false))
        host_.log().info("the name server is back", {{"name_server", server_.text()}});
}

// Where the last lease was over when something was told, that made another one: the server has forgotten all else. Its
// answer need not have arrived, so every answer says which lease it is about.
void lease_registrar::look_at_lease(std::uint64_t server, std::uint64_t number) {
    auto before = std::exchange(lease_known_, std::pair(server, number));
    if (before == lease_known_) return;
    for (auto& [path, name] : holdings_) name->told = 0;
}

// It was restarted, or we were away for too long: everything is told again, with the epochs that were granted.
void lease_registrar::lease_lost() {
    host_.log().info("the name server does not know this node any more: registering again",
                     {{"name_server", server_.text()}});
    valid_until_ = time_point::min();
    renew_at_ = time_point::max();
    for (auto& [path, name] : holdings_) name->told = 0;
    departures_.clear();
}

void lease_registrar::unreachable(const failure& why) {
    obstacle_ = fmt::format("the name server at {} does not answer: {}", server_.text(), why.message());
    if (confirmed() || host_.scope().stopping() || std::exchange(complained_, true)) return;
    bool holds = std::ranges::any_of(holdings_, [](const auto& entry) { return entry.second->epoch != 0; });
    host_.log().warning(holds ? "names are unconfirmed: they could not be renewed in time, sessions go on"
                              : "the name server does not answer, trying on: is ise_name_server running there, and "
                                "does ISE_NAME_SERVER say where?",
                        {{"name_server", server_.text()}, {"cause", why.message()}});
}

} // namespace ise
