#include <ise/component/names_watch.hpp>

#include <ise/naming/name_servers.hpp>

#include <optional>
#include <string>

namespace ise {

task<> watch_names(component& self, std::vector<endpoint> name_servers,
                   std::function<void(const naming::name_events&)> on_names,
                   std::function<void(const failure&)> on_trouble) {
    constexpr duration pause = std::chrono::seconds(1);
    if (name_servers.empty()) name_servers = usual_name_servers(self.env()).value();
    auto server = self.at(name_servers, std::string(naming::server_path));
    for (;;) {
        std::optional<failure> why;
        subscriber<subscription<naming::name_events, naming::watch_request>> names;
        try {
            names = co_await server.subscribe(naming::watch, subscribe_options::lossless(1024));
        } catch (const error& refused) {
            if (refused.code() == errc::cancelled) throw;
            why = refused.why();
        }
        if (why && on_trouble) on_trouble(*why);
        while (!why) {
            auto packet = co_await names.next();
            if (!packet) break;
            on_names(*packet);
        }
        co_await self.sleep(pause);
    }
}

} // namespace ise
