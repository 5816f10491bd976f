// ise pub: provides a subscription service in the place of a component, and publishes packets given as JSON.
#include "options.hpp"
#include "stand_in.hpp"
#include "text.hpp"

#include <ise/component/provide_dynamic.hpp>
#include <ise/service/action.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

struct pub_options {
    stand_in_options place;
    std::string service;
    std::string json;
    double rate = 0;                    ///< in Hz; 0: once
    std::optional<std::uint64_t> count; ///< packets until it ends
    std::size_t subscribers = 0;        ///< that are waited for
};

// `-`: a packet a line.
std::vector<std::string> texts_of(const pub_options& options) {
    if (options.json != "-") return {options.json};
    auto all = json_given("-");
    std::vector<std::string> lines;
    for (std::size_t at = 0; at < all.size();) {
        auto end = std::min(all.find('\n', at), all.size());
        auto line = all.substr(at, end - at);
        at = end + 1;
        if (line.find_first_not_of(" \t\r") != line.npos) lines.push_back(std::move(line));
    }
    if (lines.empty())
        throw problem(exit_code::usage, "usage", "standard input has no packet", "give one JSON object a line");
    return lines;
}

task<> pub(context& in, pub_options options, std::vector<std::string> texts) {
    auto checking = check_place(in, options.place);
    co_await std::move(checking);
    auto service = co_await contract_for(in, options.place, options.service);
    if (service.kind() != service_kind::subscription || is_action(*service.types()))
        throw problem(exit_code::usage, "usage",
                      fmt::format("'{}' is not published: it is {}", options.service,
                                  is_action(*service.types()) ? "an action" : "called"),
                      is_action(*service.types()) ? "a program must provide it: docs/actions.md"
                                                  : fmt::format("answer in its place: ise mock {} {} JSON",
                                                                options.place.path, options.service));
    std::vector<dynamic_packet> packets;
    for (auto& text : texts) {
        auto packet = co_await packet_from(in, service.packet(role::published), std::move(text), "packet");
        packets.push_back(std::move(packet));
    }
    auto out = publish_dynamic(in.self, service);
    co_await take_place(in);
    while (out.subscribers() < options.subscribers) co_await in.self.sleep(std::chrono::milliseconds(10));

    const bool again = options.rate > 0;
    const auto period =
        again ? std::chrono::duration_cast<duration>(std::chrono::duration<double>(1 / options.rate)) : duration();
    const auto wanted = options.count.value_or(again ? 0 : packets.size());
    std::uint64_t sent = 0;
    for (auto at = in.self.now(); wanted == 0 || sent < wanted; at = saturating_add(at, period)) {
        co_await in.self.sleep_till(at);
        out(packets[static_cast<std::size_t>(sent % packets.size())]);
        ++sent;
    }
    if (options.count) co_return;
    // The last packet is there for whoever subscribes, until Ctrl-C.
    for (;;) co_await in.self.sleep(std::chrono::hours(1));
}

void declare_pub(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<pub_options>();
    add_stand_in(app, given->place);
    app.add_option("SERVICE", given->service, "name of a subscription service")->required();
    app.add_option("JSON", given->json, "the packet; - reads one a line from standard input")->required();
    app.add_option("--rate", given->rate, "packets a second (default: each packet once)")->type_name("HZ");
    add_count(app, given->count, "end after N packets (default: at Ctrl-C; the last packet stays there)");
    app.add_option("--subscribers", given->subscribers, "begin when so many have subscribed")->type_name("N");
    app.callback([&made, given] {
        constexpr double fastest = 1e6;
        if (!std::isfinite(given->rate) || given->rate < 0 || given->rate > fastest)
            throw problem(exit_code::usage, "usage", "--rate: must be from 0 to 1000000 Hz");
        takes_place(given->place, made);
        made.endless = true;
        auto texts = std::make_shared<std::vector<std::string>>(texts_of(*given));
        made.work = [given, texts](context& in) { return pub(in, *given, *texts); };
    });
}

} // namespace

extern const command pub_command{
    "pub", talk_group, "publishes packets in the place of a component",
    "  ise pub atirma/boat position '{\"latitude_deg\":28.1}'\n"
    "  ise pub atirma/boat position '{\"latitude_deg\":28.1}' --rate 10 --subscribers 1 -n 100\n"
    "  ise pub atirma/boat position - --rate 5 < fixes.jsonl\n",
    declare_pub};

} // namespace ise::cli
