// What a person, or with --json a program, is told while a plan is carried out.
#include "carrier.hpp"

#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace ise::cli {

std::string carrier::ready_text(const instantiation::instance_info& what, time_point began) const {
    return fmt::format("ready after {}, process {}", show_duration(in_.self.now() - began), what.process_id);
}

task<> carrier::tell(std::size_t number, std::string state, std::string outcome) {
    const auto& what = jobs_[number].what;
    std::string text;
    if (in_.set.json) {
        auto told = nlohmann::ordered_json::parse(as_json(what));
        told["step"] = number + 1;
        told["of"] = jobs_.size();
        told["state"] = state;
        told["outcome"] = outcome;
        text = told.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    } else if (state == "begun") {
        text = printable(fmt::format("[{}/{}] {}", number + 1, jobs_.size(), deployment::as_text(what, true)), true) +
               "\n";
    } else {
        auto line = fmt::format("[{}/{}] {} {} on {}: {}", number + 1, jobs_.size(), deployment::name_of(what.what),
                                what.path, what.server, state == "done" && !outcome.empty() ? "" : state);
        if (!outcome.empty()) line += (state == "done" ? "" : ": ") + outcome;
        text = printable(line) + "\n";
    }
    co_await say(std::move(text));
}

// One writer: what others say meanwhile comes after it. Whoever does not read any more gets no account, but its deed.
task<> carrier::say(std::string text) {
    unsaid_ += text;
    if (std::exchange(saying_, true)) co_return;
    struct ending {
        bool& flag;
        ~ending() { flag = false; }
    } guard{saying_};
    try {
        while (!unsaid_.empty()) {
            auto now = std::exchange(unsaid_, {});
            co_await in_.out.write(in_.self, std::move(now));
        }
    } catch (const reader_gone&) {
        unsaid_.clear();
    }
}

} // namespace ise::cli
