#include <ise/instantiation/access.hpp>

#include <ise/access/guard.hpp>
#include <ise/service/service_host.hpp>

namespace ise::instantiation {
namespace {

void check(server_context& here, const verified_peer* by, access::request what, const std::string& path) {
    auto* policy = here.self.services().access();
    if (!policy) return;
    const std::string named[] = {path};
    what.targets = named;
    if (auto denied = policy->objection(by, what, here.self.path())) throw error(std::move(*denied));
}

access::request on_host(const server_context& here, access::action what) {
    access::request wanted;
    wanted.what = what;
    wanted.host = here.self.path(); // ise/host/shore
    wanted.host.remove_prefix(wanted.host.rfind('/') + 1);
    return wanted;
}

} // namespace

void check_access(server_context& here, const verified_peer* by, access::action what, const std::string& path,
                  const std::string& type) {
    auto wanted = on_host(here, what);
    wanted.type = type;
    check(here, by, wanted, path);
}

void check_start(server_context& here, const verified_peer* by, const std::string& path, const start_request& request) {
    auto wanted = on_host(here, access::action::start);
    wanted.type = request.type;
    wanted.identity = request.identity;
    wanted.user = request.user;
    check(here, by, wanted, path);
}

void check_roles(server_context& here, const verified_peer* by, const std::map<std::string, std::int32_t>& roles) {
    for (const auto& [role, priority] : roles) {
        access::request wanted;
        wanted.what = access::action::role;
        wanted.priority = priority;
        check(here, by, wanted, role);
    }
}

void check_setting(server_context& here, const verified_peer* by, const std::string& path,
                   const std::string& parameter) {
    access::request wanted;
    wanted.what = access::action::set;
    wanted.item = parameter;
    check(here, by, wanted, path);
}

std::optional<failure> objection_to_read(server_context& here, const verified_peer* by, const std::string& path,
                                         bool keep) {
    auto* policy = here.self.services().access();
    if (!policy) return {};
    const std::string named[] = {path};
    access::request wanted;
    wanted.what = access::action::read;
    wanted.targets = named;
    auto denied = policy->objection(by, wanted, here.self.path(), false);
    if (denied && keep) (void)policy->objection(by, wanted, here.self.path(), true); // only a refusal is news
    return denied;
}

verified_peer peer_of(const subscriber_info& who) {
    verified_peer made;
    made.who = who.who;
    made.from = who.peer;
    return made;
}

} // namespace ise::instantiation
