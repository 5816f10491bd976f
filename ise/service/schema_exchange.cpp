#include <ise/service/schema_exchange.hpp>

#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

using wire::frame_type;

std::optional<std::vector<schema>> schema_exchange::all_of(const std::vector<std::uint64_t>& fingerprints) const {
    std::vector<schema> found;
    for (auto fingerprint : fingerprints) {
        auto known = book_.find(fingerprint);
        if (!known) return std::nullopt;
        found.push_back(std::move(*known));
    }
    return found;
}

void schema_exchange::need(const std::vector<std::uint64_t>& fingerprints, ready then, failed otherwise) {
    if (auto known = all_of(fingerprints)) return then(*known);
    if (open_.size() >= limit::schema_questions)
        return otherwise(failure(errc::overloaded, fmt::format("{} questions for schemas are open (schema_questions)", open_.size())));
    wire::schema_request asked;
    for (auto fingerprint : fingerprints)
        if (!book_.find(fingerprint)) asked.fingerprints.push_back(fingerprint);
    open_.push_back(question{fingerprints, std::move(then), std::move(otherwise)});
    wire::put_frame(connection_.out().control(), frame_type::schema_request, 0, 0, [&](buffer& body) { encode(asked, body); });
    connection_.written();
}

bool schema_exchange::asked_for(std::uint64_t fingerprint) const {
    auto waits = [&](const question& asked) { return std::ranges::find(asked.fingerprints, fingerprint) != asked.fingerprints.end(); };
    return std::ranges::any_of(open_, waits);
}

result<void> schema_exchange::on_request(bytes_view body) {
    auto asked = wire::read_body<wire::schema_request>(body);
    if (!asked) return asked.error();
    if (asked->fingerprints.size() > limit::asked_schemas)
        return failure(errc::too_large, fmt::format("more than {} schemas were asked for at once (asked_schemas)", limit::asked_schemas));
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
        wire::put_frame(connection_.out().control(), frame_type::schema, 0, 0, [&](buffer& out) { encode(answer, out); });
    }
    connection_.written();
    return {};
}

result<void> schema_exchange::on_answer(bytes_view body) {
    auto answer = wire::read_body<wire::schema_answer>(body);
    if (!answer) return answer.error();
    if (!asked_for(answer->fingerprint)) return {}; // nothing is learnt that nobody wanted to know
    std::optional<failure> problem;
    if (book_.find(answer->fingerprint)) { // another session was told meanwhile
    } else if (answer->text.empty()) {
        problem.emplace(errc::type_mismatch, fmt::format("the peer does not know its own schema {:016x}", answer->fingerprint));
    } else {
        auto parsed = schema::parse(answer->text);
        if (!parsed) {
            problem.emplace(parsed.error());
        } else if (parsed->fingerprint() != answer->fingerprint) {
            problem.emplace(errc::malformed, fmt::format("the peer's schema has fingerprint {:016x}, {:016x} was announced",
                                                         parsed->fingerprint(), answer->fingerprint));
        } else {
            book_.learn(*parsed);
        }
    }
    // Answering may ask anew: the questions that are decided now are taken out first.
    std::vector<question> decided;
    std::erase_if(open_, [&](question& asked) {
        bool concerned = std::find(asked.fingerprints.begin(), asked.fingerprints.end(), answer->fingerprint) != asked.fingerprints.end();
        if (!concerned || (!problem && !all_of(asked.fingerprints))) return false;
        decided.push_back(std::move(asked));
        return true;
    });
    for (auto& asked : decided) {
        if (problem) {
            asked.otherwise(*problem);
        } else {
            asked.then(*all_of(asked.fingerprints));
        }
    }
    return {};
}

} // namespace ise
