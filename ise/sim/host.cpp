#include <ise/sim/host.hpp>

#include <ise/sim/datagram_end.hpp>
#include <ise/sim/tcp_acceptor.hpp>
#include <ise/sim/world.hpp>

#include <fmt/format.h>

namespace ise::sim {
namespace {

bool loopback(const std::string& host) { return host == "localhost" || host.starts_with("127.") || host == "::1"; }
bool wildcard(const std::string& host) { return host == "0.0.0.0" || host == "::"; }
bool v6(const std::string& host) { return host.find(':') != std::string::npos; }

// Whether something bound at `at` hears what is sent to `to`.
bool hears(const endpoint& at, const std::string& to_host, bool own_name, const std::string& address) {
    if (wildcard(at.host)) return v6(at.host) == v6(to_host);
    if (own_name) return at.host == address;
    return at.host == to_host;
}

} // namespace

host::host(sim::world& world, std::string name, std::string address)
    : world_(world), name_(std::move(name)), address_(std::move(address)) {}
host::~host() = default;

bool host::is_me(const std::string& other) const {
    return loopback(other) || wildcard(other) || other == name_ || other == address_;
}

std::uint16_t host::ephemeral_port() {
    const auto port = next_port_;
    next_port_ = next_port_ == 65535 ? std::uint16_t{49152} : static_cast<std::uint16_t>(next_port_ + 1);
    return port;
}

// Where a listener or a datagram port is bound, given what is bound already.
result<void> host::claim(endpoint& at, const endpoint& wanted, const std::vector<endpoint>& taken) {
    at = wanted;
    if (at.kind == protocol::local) {
        for (const auto& other : taken)
            if (other.kind == protocol::local && other.path == at.path)
                return failure(errc::address_in_use, fmt::format("cannot listen on {}: address in use on host '{}'", at.text(), name_));
        return {};
    }
    if (at.host == "localhost") at.host = "127.0.0.1";
    if (at.host == name_) at.host = address_;
    if (!is_me(at.host))
        return failure(errc::io_failed, fmt::format("cannot listen on {}: host '{}' has no such address, it has {}",
                                                    at.text(), name_, address_));
    auto conflicts = [&](std::uint16_t port) {
        for (const auto& other : taken)
            if (other.kind == at.kind && other.port == port &&
                (other.host == at.host ||
                 (v6(other.host) == v6(at.host) && (wildcard(other.host) || wildcard(at.host)))))
                return true;
        return false;
    };
    if (at.port != 0) {
        if (conflicts(at.port))
            return failure(errc::address_in_use, fmt::format("cannot listen on {}: address in use on host '{}'", at.text(), name_));
        return {};
    }
    for (int tries = 0; tries < 16384; ++tries) {
        at.port = ephemeral_port();
        if (!conflicts(at.port)) return {};
    }
    return failure(errc::address_in_use, fmt::format("cannot listen on {}: no free port on host '{}'", wanted.text(), name_));
}

tcp_acceptor* host::acceptor_for(const endpoint& to) const {
    const auto to_host = to.host == "localhost" ? std::string("127.0.0.1") : to.host;
    for (auto* each : acceptors) {
        const auto& at = each->at();
        if (at.kind != to.kind) continue;
        if (at.kind == protocol::local ? at.path == to.path
                                       : at.port == to.port && hears(at, to_host, to_host == name_, address_))
            return each;
    }
    return nullptr;
}

datagram_end* host::datagram_for(const endpoint& to) const {
    const auto to_host = to.host == "localhost" ? std::string("127.0.0.1") : to.host;
    for (auto* each : datagrams)
        if (each->at().port == to.port && hears(each->at(), to_host, to_host == name_, address_)) return each;
    return nullptr;
}

process& host::start_process(std::string name, program run, std::map<std::string, std::string> variables) {
    if (!up_) throw std::logic_error(fmt::format("host '{}' is down: boot() it first", name_));
    const auto life = ++lives_[name];
    world_.note("start", name_ + "/" + name, life);
    processes_.push_back(std::make_unique<process>(*this, std::move(name), life, next_process_id_++, std::move(run),
                                                   std::move(variables)));
    auto& made = *processes_.back();
    made.start();
    return made;
}

void host::end_processes(bool quietly) {
    for (std::size_t i = 0; i < processes_.size(); ++i) // ending one may not start another, but who knows
        if (processes_[i]->running()) processes_[i]->finish(quietly ? ending::host_lost : ending::crash);
}

void host::crash() {
    if (!up_) return;
    world_.note("host_lost", name_);
    up_ = false;
    end_processes(true);
}

void host::boot() {
    if (up_) return;
    up_ = true;
    ++boots_;
    world_.note("boot", name_, boots_);
    world_.net().look_again();
}

} // namespace ise::sim
