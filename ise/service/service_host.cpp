#include <ise/service/service_host.hpp>

#include <ise/access/guard.hpp>
#include <ise/call/call_tap.hpp>
#include <ise/service/run_tap.hpp>
#include <ise/session/tracer.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace ise {
namespace {

constexpr std::size_t few_links = 16;

} // namespace

service_host::service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options,
                           logger log, security credentials)
    : service_runtime(env, on, scope, std::move(self), options, std::move(log)),
      uses_(*this), links_share_{*this, calls_, peers_, uses_, nullptr}, calls_(on), dispatcher_(schemas()),
      acceptor_(*this, peers_),
      peers_({*this, calls_, dispatcher_, dispatcher_, reply_windows_}, std::move(credentials)) {
    const auto& own = peers_.credentials();
    use_access(own.access, own.own);
    set_titles({this->self().path});
    if (access()) access_seen_ = access()->version();
    if (this->options().traces)
        calls_.on_span = [this](const pending_call& call, const failure* why) {
            trace_id caused = call.trace;
            caused.parent = call.caused_by;
            this->options().traces->ended(caused, call.trace.parent, span::side::client, why ? why->code() : errc{},
                                          call.began, this->on().now() - call.began, call.service, this->self().path,
                                          call.owner->name());
        };
}

void service_host::follow_access() {
    if ((!access() && !peers_.credentials().tls) || access_watch_) return;
    access_watch_ = std::make_unique<timer>(on(), [this] { watch_access(); });
    watch_access();
}

// An edit of the policy, or of the revocation lists, counts for what exists already.
void service_host::watch_access() {
    peers_.end_revoked();
    if (access()) follow_policy();
    if (access_watch_) access_watch_->arm(saturating_add(on().now(), access::guard::reread_after));
}

void service_host::follow_policy() {
    access()->refresh();
    auto version = access()->version();
    if (version != access_seen_) {
        access_seen_ = version;
        auto broken = access()->broken();
        if (broken) log().error(broken->message());
        else log().info("the access policy was read anew", {{"hash", access()->current()->hash()}});
        if (!broken) peers_.review_access();
    }
}

void service_host::serve_as(std::vector<std::string> roles) {
    roles.insert(roles.begin(), self().path);
    if (roles == titles()) return;
    set_titles(std::move(roles));
    if (access()) peers_.review_access();
}

service_host::~service_host() { links_share_.names.reset(); }

// An entry keeps the memory of its link also once that has gone: they are removed when there are twice as many.
std::weak_ptr<peer_channel>& service_host::known_link(const std::string& key) {
    if (links_.size() >= sweep_links_at_) {
        std::erase_if(links_, [](const auto& entry) { return entry.second.expired(); });
        sweep_links_at_ = 2 * links_.size() + few_links;
    }
    return links_[key];
}

std::shared_ptr<peer_channel> service_host::link_to(const std::string& path, role_options how) {
    // No path has a blank.
    auto& known = known_link(how.failback ? fmt::format("{} {}", path, how.failback_delay.count()) : path + " stay");
    auto held = known.lock();
    if (!held) known = held = std::make_shared<peer_channel>(links_share_, path, std::vector<endpoint>(), how);
    return held;
}

std::shared_ptr<peer_channel> service_host::link_to(const std::vector<endpoint>& any_of, const std::string& path) {
    auto& known = known_link(fmt::format("{} {}", text_of(any_of), path));
    auto held = known.lock();
    if (!held) known = held = std::make_shared<peer_channel>(links_share_, path, any_of);
    return held;
}

std::shared_ptr<peer_channel> service_host::link_back(const std::shared_ptr<session>& over) {
    return std::make_shared<peer_channel>(links_share_, over);
}

void service_host::stop(duration grace) {
    if (!begin_stop()) return;
    access_watch_.reset();
    uses_.stop();
    acceptor_.close();
    dispatcher_.stop();
    if (call_taps::any()) on().common<call_taps>().ignore(*this);
    on().common<run_taps>().ignore(*this);
    for (auto& [name, known] : links_)
        if (auto held = known.lock()) held->stop();
    peers_.finish_all(failure(errc::peer_lost, "the component stops"), grace);
}

void service_host::pause(const failure& why, duration grace) {
    acceptor_.pause(why);
    peers_.finish_all(why, grace);
}

} // namespace ise
