#include <ise/service/service_host.hpp>

#include <fmt/format.h>

namespace ise {

service_host::service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options,
                           logger log, security credentials)
    : service_runtime(env, on, scope, std::move(self), options, std::move(log)),
      uses_(*this), links_share_{*this, calls_, peers_, uses_, nullptr}, calls_(on), dispatcher_(schemas()),
      acceptor_(*this, peers_),
      peers_({*this, calls_, dispatcher_, dispatcher_, reply_windows_}, std::move(credentials)) {}

service_host::~service_host() { links_share_.names.reset(); }

std::shared_ptr<peer_channel> service_host::link_to(const std::string& path, role_options how) {
    // No path has a blank.
    auto& known = links_[how.come_back ? fmt::format("{} {}", path, how.steady.count()) : path + " stay"];
    auto held = known.lock();
    if (!held) known = held = std::make_shared<peer_channel>(links_share_, path, std::nullopt, how);
    return held;
}

std::shared_ptr<peer_channel> service_host::link_to(const endpoint& at, const std::string& path) {
    auto& known = links_[path.empty() ? at.text() : fmt::format("{} {}", at.text(), path)];
    auto held = known.lock();
    if (!held) known = held = std::make_shared<peer_channel>(links_share_, path, at);
    return held;
}

std::shared_ptr<peer_channel> service_host::link_back(const std::shared_ptr<session>& over) {
    return std::make_shared<peer_channel>(links_share_, over);
}

void service_host::stop(duration grace) {
    if (!begin_stop()) return;
    uses_.stop();
    acceptor_.close();
    dispatcher_.stop();
    for (auto& [name, known] : links_)
        if (auto held = known.lock()) held->stop();
    peers_.finish_all(failure(errc::peer_lost, "the component stops"), grace);
}

void service_host::pause(const failure& why, duration grace) {
    acceptor_.pause(why);
    peers_.finish_all(why, grace);
}

} // namespace ise
