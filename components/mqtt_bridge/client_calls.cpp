#include <components/mqtt_bridge/client_calls.hpp>

#include <components/mqtt_bridge/payload_codec.hpp>
#include <components/mqtt_bridge/topics.hpp>

#include <ise/core/readable.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>

namespace ise::mqtt {
namespace {

constexpr std::size_t max_calls_at_once = 256;
constexpr std::size_t min_correlation = 8, max_correlation = 256;

std::string key_of(const message& asked) { return asked.response_topic + '\0' + asked.correlation; }

call_outcome outcome_of(const failure& why) {
    call_outcome made;
    made.code = name_of(why.code());
    made.execution = name_of(why.executed());
    nlohmann::ordered_json text;
    text["code"] = made.code;
    text["execution"] = made.execution;
    text["text"] = why.message();
    made.payload = text.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
    return made;
}

} // namespace

struct client_calls::callable {
    callable(std::string of, dynamic_contract service, bool protobuf)
        : path(std::move(of)), contract(std::move(service)), request(contract.packet(role::request), protobuf),
          response(contract.packet(role::response), protobuf) {}
    std::string path;
    dynamic_contract contract;
    payload_codec request, response;
};

client_calls::client_calls(std::shared_ptr<bridge_context> in, std::shared_ptr<outgoing_messages> to,
                           std::shared_ptr<database> disk, std::uint64_t life)
    : in_(std::move(in)), to_(std::move(to)), disk_(std::move(disk)), journal_(*disk_, life, in_->options.remember) {}

void client_calls::add(const std::string& path, const dynamic_contract& service) {
    if (!in_->options.allow_calls) return;
    all_[{path, service.name()}] = std::make_shared<callable>(path, service, in_->options.protobuf);
}

void client_calls::answer(const message& asked, const call_outcome& outcome) {
    message made;
    made.topic = asked.response_topic;
    made.correlation = asked.correlation;
    made.payload = outcome.payload;
    made.content_type = outcome.code == "ok" && in_->options.protobuf ? "application/protobuf" : "application/json";
    made.user.emplace_back("code", outcome.code);
    if (!outcome.execution.empty()) made.user.emplace_back("execution", outcome.execution);
    to_->answer(std::move(made));
}

void client_calls::refuse(const message& asked, errc code, std::string why) {
    ++in_->counts.calls_failed;
    answer(asked, outcome_of(failure(code, std::move(why))));
}

std::string client_calls::unanswerable(std::string_view topic) const {
    const auto& prefix = in_->options.prefix;
    if (topic.empty()) return "it has no response topic (MQTT 5)";
    if (topic.size() > max_topic_bytes) // it is noted with each request
        return fmt::format("its response topic has {} bytes, {} at most (max_topic_bytes)", topic.size(),
                           max_topic_bytes);
    // An answer there would pass as a packet of a component, or be a request itself.
    if (topic.starts_with(prefix) && (topic.size() == prefix.size() || topic[prefix.size()] == '/'))
        return fmt::format("its response topic is one of the bridge's own, which begin with {}/", readable(prefix));
    return {};
}

void client_calls::take(message asked) {
    if (auto why = unanswerable(asked.response_topic); !why.empty()) {
        ++in_->counts.not_published;
        in_->note(fmt::format("a request of {} is not executed: {}", readable(asked.topic.substr(0, 200)), why));
        return;
    }
    if (asked.correlation.size() < min_correlation || asked.correlation.size() > max_correlation)
        return refuse(asked, errc::invalid_argument,
                      fmt::format("a request needs correlation data of {} to {} bytes that no other request has, such "
                                  "as a UUID: by it a request that is delivered twice is executed once",
                                  min_correlation, max_correlation));
    auto place = read_topic(in_->options.prefix, "call", asked.topic);
    if (!place) return refuse(asked, place.error().code(), place.error().message());
    if (!paths_.contains(place->path))
        return refuse(asked, errc::no_such_name, fmt::format("the bridge shows no '{}'", place->path));
    auto found = all_.find({place->path, place->service});
    if (found == all_.end())
        return refuse(
            asked, errc::no_such_service,
            fmt::format("the bridge shows no request-response service '{}' of '{}'", place->service, place->path));
    auto request = found->second->request.decode(asked.payload);
    if (!request) return refuse(asked, request.error().code(), request.error().message());
    if (calls_ >= max_calls_at_once)
        return refuse(asked, errc::overloaded, fmt::format("{} calls are being made (max_calls_at_once)", calls_));
    auto noted = journal_.begin(key_of(asked), asked.topic, asked.payload, in_->self.wall());
    if (!noted)
        return refuse(asked, errc::io_failed,
                      fmt::format("the request cannot be noted, and is not executed: {}", noted.error().message()));
    switch (noted->is) {
        case call_journal::state::fresh: break;
        case call_journal::state::running: ++in_->counts.calls_again; return; // it is answered when it is done
        case call_journal::state::answered: ++in_->counts.calls_again; return answer(asked, noted->outcome);
        case call_journal::state::dropped:
        case call_journal::state::interrupted:
            ++in_->counts.calls_again;
            return answer(asked, outcome_of(failure(errc::peer_lost,
                                                    noted->is == call_journal::state::dropped
                                                        ? "the answer to this request is not kept any more "
                                                          "(max_answer_bytes); it is not executed again"
                                                        : "the bridge ended while this request was executed; it is "
                                                          "not executed again",
                                                    execution::unknown)));
        case call_journal::state::other:
            return refuse(asked, errc::invalid_argument,
                          "another request had the same correlation data: each needs its own, such as a UUID");
    }
    ++in_->counts.calls;
    ++calls_;
    in_->self.spawn("call " + asked.topic.substr(0, 200),
                    call(shared_from_this(), found->second, std::move(*request), std::move(asked)));
}

task<> client_calls::call(std::shared_ptr<client_calls> me, std::shared_ptr<callable> service, dynamic_packet request,
                          message asked) {
    struct ending {
        client_calls& of;
        ~ending() { --of.calls_; }
    } guard{*me};
    auto& in = *me->in_;
    auto deadline = in.options.call_deadline;
    if (asked.expiry_s) deadline = std::min<duration>(deadline, std::chrono::seconds(std::max(*asked.expiry_s, 1u)));
    auto provider = in.self.at(service->path);
    auto got = co_await call_dynamic(provider, service->contract, std::move(request), deadline);
    call_outcome outcome;
    if (got) {
        auto payload = service->response.encode(*got);
        if (payload) {
            outcome.code = "ok";
            outcome.payload = std::move(*payload);
        } else {
            outcome = outcome_of(
                failure(payload.error().code(),
                        fmt::format("it was executed, but its response is not sent: {}", payload.error().message()),
                        execution::unknown));
        }
    } else {
        outcome = outcome_of(got.error());
    }
    if (outcome.code != "ok") ++in.counts.calls_failed;
    if (auto noted = me->journal_.end(key_of(asked), outcome); !noted)
        in.note(fmt::format("an answer cannot be noted: {}", noted.error().message()));
    me->answer(asked, outcome);
}

void client_calls::tidy() {
    if (auto done = journal_.tidy(in_->self.wall()); !done) in_->note(done.error().message());
}

} // namespace ise::mqtt
