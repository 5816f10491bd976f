#include <ise/component/system_watch.hpp>

#include <ise/core/environment.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace ise {
namespace {

constexpr duration question_deadline = std::chrono::seconds(5);
constexpr duration pause_between_tries = std::chrono::seconds(1);

bool is_among(const std::vector<std::string>& all, const std::string& one) {
    return std::ranges::find(all, one) != all.end();
}

} // namespace

bool service_selection::has(const std::string& path) const {
    return paths.empty() || std::ranges::any_of(paths, [&](const auto& one) { return naming::lies_below(path, one); });
}

bool service_selection::has(const service_text& service) const {
    if (!service.provided || is_among(except, service.name)) return false;
    if (!services.empty()) return is_among(services, service.name);
    return own_services || !service.name.starts_with("ise.");
}

void service_selection::add_to(parameter_set& set) {
    set.add("show", paths, "components, each with those below it; none: all");
    set.add("only", services, "only these services");
    set.add("except", except, "services that are left out");
}

struct system_watch::state : std::enable_shared_from_this<state> {
    state(component& of, service_selection what, std::vector<endpoint> servers, system_news to)
        : self(of), wanted(std::move(what)), name_servers(std::move(servers)), news(std::move(to)) {}

    struct followed {
        bool asking = false, again = false;
        bool told = false; // that it cannot be asked
    };

    component& self;
    service_selection wanted;
    std::vector<endpoint> name_servers;
    system_news news;
    std::map<std::string, followed> components; // by path
    bool over = false;

    void forget(const std::string& path) {
        if (components.erase(path) > 0) news.gone(path);
    }

    void on_names(const naming::name_events& told) {
        std::set<std::string> present;
        for (const auto& one : told.events) {
            const auto& path = one.name.path;
            if (!wanted.has(path) || path == self.path()) continue;
            if (one.what == naming::name_change::removed) {
                forget(path);
                continue;
            }
            present.insert(path);
            ask(path);
        }
        if (!told.snapshot) return;
        std::vector<std::string> old;
        for (const auto& [path, about] : components)
            if (!present.contains(path)) old.push_back(path);
        for (const auto& path : old) forget(path);
    }

    void ask(const std::string& path) {
        auto& of = components[path];
        if (std::exchange(of.asking, true)) {
            of.again = true;
            return;
        }
        self.spawn("follow " + path, follow(shared_from_this(), path));
    }

    static task<> follow(std::shared_ptr<state> me, std::string path) {
        auto who = me->self.at(path);
        for (;;) {
            describe_request question;
            auto told = co_await who.try_call(describe_service, question, question_deadline);
            auto found = me->components.find(path);
            if (me->over || found == me->components.end()) co_return; // it has gone
            if (told) {
                found->second.told = false;
                me->news.described(path, std::move(*told));
                found = me->components.find(path);
                if (me->over || found == me->components.end()) co_return;
                if (!std::exchange(found->second.again, false)) {
                    found->second.asking = false;
                    co_return;
                }
            } else {
                if (!std::exchange(found->second.told, true))
                    me->news.trouble(fmt::format("'{}' is not shown yet: {}", path, told.error().message()));
                co_await me->self.sleep(question_deadline);
                if (me->over || !me->components.contains(path)) co_return;
            }
        }
    }

    static task<> watch_names(std::shared_ptr<state> me) {
        auto& self = me->self;
        auto where = me->name_servers;
        if (where.empty()) where = usual_name_servers(self.env()).value();
        auto server = self.at(where, std::string(naming::server_path));
        while (!me->over) {
            subscriber<subscription<naming::name_events, naming::watch_request>> names;
            bool subscribed = false;
            try {
                names = co_await server.subscribe(naming::watch, subscribe_options::lossless(1024));
                subscribed = true;
            } catch (const error& refused) {
                if (refused.code() == errc::cancelled) throw;
                if (!me->over) me->news.trouble(fmt::format("names are not known: {}", refused.what()));
            }
            while (subscribed) {
                auto packet = co_await names.next();
                if (!packet || me->over) break;
                me->on_names(*packet);
            }
            co_await self.sleep(pause_between_tries);
        }
    }
};

system_watch::system_watch(component& self, service_selection wanted, std::vector<endpoint> name_servers,
                           system_news news)
    : state_(std::make_shared<state>(self, std::move(wanted), std::move(name_servers), std::move(news))) {
    self.spawn("names", state::watch_names(state_));
}
system_watch::~system_watch() { state_->over = true; }

} // namespace ise
