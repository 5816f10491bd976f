#include <components/foxglove_gateway/shown_services.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <optional>

namespace ise::foxglove {

struct shown_services::callable {
    callable(std::string of, dynamic_contract service)
        : path(std::move(of)), contract(std::move(service)), request(contract.packet(role::request)),
          response(contract.packet(role::response)) {
        info.name = fmt::format("{}/{}", path, contract.name());
        info.type = request.name();
        info.request = protobuf_schema(request.name(), request.descriptors());
        info.response = protobuf_schema(response.name(), response.descriptors());
    }

    result<dynamic_packet> request_of(const call_message& asked) const {
        try {
            const auto& type = contract.packet(role::request);
            if (asked.encoding == "json") return dynamic_packet::from_json(type, asked.payload);
            auto packet = request.decode_fields(as_bytes(asked.payload), message_limits());
            if (!packet) return packet.error();
            return dynamic_packet(type, std::move(*packet));
        } catch (const error& why) {
            return why.why();
        }
    }
    result<std::string> response_to(const call_message& asked, const dynamic_packet& answer) const {
        try {
            if (asked.encoding == "json")
                return to_json(answer.type(), answer.encoded(), json_style::compact, max_message_bytes);
            buffer made;
            auto done = response.encode(answer.encoded(), made, false, message_limits());
            if (!done) return done.error();
            return std::string(as_text(made.view()));
        } catch (const error& why) {
            return why.why();
        }
    }

    std::string path;
    dynamic_contract contract;
    bag::protobuf_type request, response;
    service_info info;
};

void shown_services::add(const std::string& path, const dynamic_contract& service) {
    if (!in_->options.allow_calls) return;
    auto made = std::make_shared<callable>(path, service);
    made->info.id = in_->number_of(fmt::format("service\n{}\n{}\n{}", made->info.name, identity_of(made->info.request),
                                               identity_of(made->info.response)));
    advertised_.add(made);
    all_[{path, service.name()}] = made;
}

void shown_services::remove(const std::string& path, const std::string& service) {
    auto found = all_.find({path, service});
    if (found == all_.end()) return;
    advertised_.remove(found->second->info.id);
    all_.erase(found);
}

void shown_services::announce() { advertised_.announce(*to_); }

std::shared_ptr<const std::string> shown_services::list() { return advertised_.list(); }

void shown_services::take(const std::shared_ptr<viewer>& who, call_message& asked) {
    auto fails = [&](std::string why) {
        who->text(write_call_failure(asked.service, asked.call, why));
        ++in_->counts.calls_failed;
    };
    if (!in_->options.allow_calls) return fails("viewers may not call services here (--allow-calls)");
    auto service = advertised_.find(asked.service);
    if (!service) return fails(fmt::format("there is no service {}", asked.service));
    if (asked.encoding != "json" && asked.encoding != "protobuf")
        return fails(fmt::format("the encoding is '{}', not protobuf or json", asked.encoding));
    auto under_way = to_->begin(who);
    if (!under_way) return fails(to_->too_much(*who));
    ++in_->counts.calls;
    auto name = "call " + service->info.name;
    in_->self.spawn(std::move(name),
                    call(shared_from_this(), who, std::move(service), std::move(asked), std::move(*under_way)));
}

task<> shown_services::call(std::shared_ptr<shown_services> me, std::shared_ptr<viewer> who,
                            std::shared_ptr<callable> service, call_message asked,
                            [[maybe_unused]] viewer_sessions::operation under_way) {
    auto& in = *me->in_;
    auto request = service->request_of(asked);
    std::optional<failure> why;
    std::string payload;
    if (request) {
        auto provider = in.self.at(service->path);
        auto answer = co_await call_dynamic(provider, service->contract, std::move(*request), in.options.call_deadline);
        if (answer) {
            auto made = service->response_to(asked, *answer);
            if (made) payload = std::move(*made);
            else why = made.error();
        } else {
            why = answer.error();
        }
    } else {
        why = request.error();
    }
    if (!why) {
        who->binary(write_call_response(asked, payload));
        co_return;
    }
    ++in.counts.calls_failed;
    auto text = fmt::format("{}: {}", name_of(why->code()), why->message());
    if (why->executed() == execution::unknown) text += " (it may have been executed)";
    who->text(write_call_failure(asked.service, asked.call, text));
}

} // namespace ise::foxglove
