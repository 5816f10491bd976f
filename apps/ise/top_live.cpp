#include "top_live.hpp"

#include "output.hpp"
#include "top_view.hpp"

#include <ise/core/error.hpp>
#include <ise/naming/name_servers.hpp>

#include <chrono>
#include <optional>
#include <string>
#include <utility>

namespace ise::cli {
namespace {

constexpr duration key_period = std::chrono::milliseconds(40);

// Shared by the one who draws and the one who asks.
struct live_survey {
    survey_options what;
    bool asking = false;
    std::optional<std::vector<surveyed>> made;
    std::string trouble;
};

task<> survey_again(context from, std::shared_ptr<live_survey> of) {
    from.until = saturating_add(from.self.now(), from.set.timeout);
    try {
        auto made = co_await survey(from, of->what);
        of->made = std::move(made);
    } catch (const problem& why) {
        of->trouble = why.what();
    } catch (const error& why) {
        of->trouble = why.what();
    }
    of->asking = false;
}

} // namespace

task<> top_live(context& in, survey_options what, duration every, std::vector<surveyed> first,
                std::unique_ptr<terminal> on) {
    auto of = std::make_shared<live_survey>();
    of->what = std::move(what);
    top_view view(text_of(name_servers_of(in.set, in.self.env())));
    view.take(std::move(first), in.self.wall());
    auto next = saturating_add(in.self.now(), every);
    for (bool fresh = true;;) {
        while (auto key = on->read()) {
            view.press(*key);
            fresh = true;
        }
        if (view.ended()) co_return;
        if (on->gone()) throw reader_gone();
        if (of->made) {
            view.take(std::move(*of->made), in.self.wall());
            of->made.reset();
            fresh = true;
        }
        if (!of->trouble.empty()) {
            view.fail(std::exchange(of->trouble, {}));
            fresh = true;
        }
        if (!of->asking && !view.paused() && in.self.now() >= next) {
            next = std::max(saturating_add(next, every), in.self.now());
            of->asking = true;
            in.self.spawn("survey", survey_again(in, of));
        }
        if (fresh) fresh = !on->show(view.page(on->width(), on->height()));
        co_await in.self.sleep_till(saturating_add(in.self.now(), key_period));
    }
}

} // namespace ise::cli
