#include <ise/session/schema_exchange.hpp>

#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

using wire::frame_type;

void schema_exchange::need(const std::vector<std::uint64_t>& fingerprints, ready then, failed otherwise) {
    question asked{fingerprints, {}, std::move(then), std::move(otherwise)};
    wire::schema_request unknown;
    for (auto fingerprint : fingerprints) {
        const auto* known = find(fingerprint);
        asked.schemas.push_back(known ? std::optional(*known) : std::nullopt);
        if (!known) unknown.fingerprints.push_back(fingerprint);
    }
    if (unknown.fingerprints.empty()) return hand_over(asked);
    if (open_.size() >= limit::schema_questions)
        return asked.otherwise(failure(
            errc::overloaded, fmt::format("{} questions for schemas are open (schema_questions)", open_.size())));
    open_.push_back(std::move(asked));
    wire::put_frame(connection_.out().control(), frame_type::schema_request, 0, 0,
                    [&](buffer& body) { encode(unknown, body); });
    connection_.written();
}

const schema* schema_exchange::find(std::uint64_t fingerprint) const {
    if (const auto* declared = book_.find_declared(fingerprint)) return declared;
    auto found = received_.find(fingerprint);
    return found == received_.end() ? nullptr : &found->second;
}

std::optional<failure> schema_exchange::hold(const schema& one) {
    const auto with_it = held_bytes_ + schema_cache::cost_of(one);
    if (with_it > max_bytes_)
        return failure(errc::overloaded,
                       fmt::format("the schemas of this session would take {} bytes, {} are allowed (session_bytes)",
                                   with_it, max_bytes_));
    received_.emplace(one.fingerprint(), one);
    held_bytes_ = with_it;
    return std::nullopt;
}

void schema_exchange::hand_over(question& asked) {
    std::vector<schema> theirs;
    for (auto& one : asked.schemas) theirs.push_back(std::move(*one));
    asked.then(theirs);
}

bool schema_exchange::asked_for(std::uint64_t fingerprint) const {
    auto waits = [&](const question& asked) {
        return std::ranges::find(asked.fingerprints, fingerprint) != asked.fingerprints.end();
    };
    return std::ranges::any_of(open_, waits);
}

result<void> schema_exchange::on_request(bytes_view body) {
    auto asked = wire::read_body<wire::schema_request>(body);
    if (!asked) return asked.error();
    if (asked->fingerprints.size() > limit::asked_schemas)
        return failure(errc::too_large, fmt::format("more than {} schemas were asked for at once (asked_schemas)",
                                                    limit::asked_schemas));
    // Each once; and a text is much longer than the question for it.
    std::ranges::sort(asked->fingerprints);
    auto repeated = std::ranges::unique(asked->fingerprints);
    asked->fingerprints.erase(repeated.begin(), repeated.end());
    for (auto fingerprint : asked->fingerprints) {
        if (connection_.out().control().size() > limit::control_bytes) break; // the connection ends over that
        auto known = book_.find(fingerprint);
        wire::schema_answer answer;
        answer.fingerprint = fingerprint;
        if (known) answer.text = known->text();
        wire::put_frame(connection_.out().control(), frame_type::schema, 0, 0,
                        [&](buffer& out) { encode(answer, out); });
    }
    connection_.written();
    return {};
}

namespace {
result<schema> read_schema(const wire::schema_answer& outcome) {
    if (outcome.text.empty())
        return failure(errc::type_mismatch,
                       fmt::format("the peer does not know its own schema {:016x}", outcome.fingerprint));
    auto parsed = schema::parse(outcome.text);
    if (parsed && parsed->fingerprint() != outcome.fingerprint)
        return failure(errc::malformed, fmt::format("the peer's schema has fingerprint {:016x}, {:016x} was announced",
                                                    parsed->fingerprint(), outcome.fingerprint));
    return parsed;
}
} // namespace

result<void> schema_exchange::on_answer(bytes_view body) {
    auto answer = wire::read_body<wire::schema_answer>(body);
    if (!answer) return answer.error();
    if (!asked_for(answer->fingerprint)) return {}; // nothing is learnt that nobody wanted to know
    std::optional<failure> problem;
    std::optional<schema> known;
    if (const auto* before = find(answer->fingerprint)) { // it was asked for twice
        known = *before;
    } else if (auto read = read_schema(*answer)) {
        known = std::move(*read);
        problem = hold(*known);
    } else {
        problem.emplace(read.error());
    }
    // Answering may ask anew: the questions that are decided now are taken out first.
    std::vector<question> decided;
    std::erase_if(open_, [&](question& asked) {
        bool concerned = false;
        for (std::size_t at = 0; at < asked.schemas.size(); ++at) {
            if (asked.fingerprints[at] != answer->fingerprint) continue;
            concerned = true;
            asked.schemas[at] = known;
        }
        if (!concerned ||
            (!problem && !std::ranges::all_of(asked.schemas, [](const auto& one) { return one.has_value(); })))
            return false;
        decided.push_back(std::move(asked));
        return true;
    });
    for (auto& asked : decided) {
        if (problem) {
            asked.otherwise(*problem);
        } else {
            hand_over(asked);
        }
    }
    return {};
}

} // namespace ise
