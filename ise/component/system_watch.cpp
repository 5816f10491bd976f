#include <ise/component/system_watch.hpp>

#include <ise/component/names_watch.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace ise {
namespace {

constexpr duration question_deadline = std::chrono::seconds(5);

bool is_among(const std::vector<std::string>& all, const std::string& one) {
    return std::ranges::find(all, one) != all.end();
}

} // namespace

bool service_selection::has(const std::string& path) const {
    return paths.empty() || std::ranges::any_of(paths, [&](const auto& one) { return naming::lies_below(path, one); });
}

bool service_selection::has(const service_info& service) const {
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
    state(component& of, service_selection what, system_news to)
        : self(of), wanted(std::move(what)), news(std::move(to)) {}

    struct followed {
        bool asking = false, again = false;
        bool reported = false; // that it cannot be asked
    };

    component& self;
    service_selection wanted;
    system_news news;
    std::map<std::string, followed> components; // by path
    bool over = false;

    void forget(const std::string& path) {
        if (components.erase(path) > 0) news.gone(path);
    }

    void on_names(const naming::name_events& result) {
        std::set<std::string> present;
        for (const auto& one : result.events) {
            const auto& path = one.name.path;
            if (!wanted.has(path) || path == self.path()) continue;
            if (one.what == naming::name_change::removed) {
                forget(path);
                continue;
            }
            present.insert(path);
            ask(path);
        }
        if (!result.snapshot) return;
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
            auto response = co_await who.try_call(describe_service, question, question_deadline);
            auto found = me->components.find(path);
            if (me->over || found == me->components.end()) co_return; // it has gone
            if (response) {
                found->second.reported = false;
                me->news.described(path, std::move(*response));
                found = me->components.find(path);
                if (me->over || found == me->components.end()) co_return;
                if (!std::exchange(found->second.again, false)) {
                    found->second.asking = false;
                    co_return;
                }
            } else {
                if (!std::exchange(found->second.reported, true))
                    me->news.trouble(fmt::format("'{}' is not shown yet: {}", path, response.error().message()));
                co_await me->self.sleep(question_deadline);
                if (me->over || !me->components.contains(path)) co_return;
            }
        }
    }
};

system_watch::system_watch(component& self, service_selection wanted, std::vector<endpoint> name_servers,
                           system_news news)
    : state_(std::make_shared<state>(self, std::move(wanted), std::move(news))) {
    std::function<void(const naming::name_events&)> on_names = [held = state_](const naming::name_events& result) {
        if (!held->over) held->on_names(result);
    };
    std::function<void(const failure&)> on_trouble = [held = state_](const failure& why) {
        if (!held->over) held->news.trouble(fmt::format("names are not known: {}", why.message()));
    };
    self.spawn("names", watch_names(self, std::move(name_servers), std::move(on_names), std::move(on_trouble)));
}
system_watch::~system_watch() { state_->over = true; }

} // namespace ise
