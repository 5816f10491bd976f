// link: atirma_mail
// What an IMAP server may send, whole and in pieces: both ways the same replies come out.
#include <components/mail/imap_replies.hpp>
#include <components/mail/imap_text.hpp>

#include <cstdint>
#include <cstdlib>

namespace {

struct heard {
    std::vector<std::string> replies;
    bool broken = false;
    bool operator==(const heard&) const = default;
};

void take(atirma::imap_replies& from, heard& into) {
    for (;;) {
        auto next = from.next();
        if (!next) into.broken = true;
        if (!next || !*next) return;
        auto text = (*next)->tag + "|" + (*next)->text;
        for (const auto& literal : (*next)->literals) text += "|" + literal;
        atirma::imap_found(text);
        atirma::imap_exists(text);
        atirma::imap_fetched_uid(text);
        atirma::imap_code(text, "UIDVALIDITY");
        into.replies.push_back(std::move(text));
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    if (size == 0) return 0;
    atirma::imap_limits limits;
    limits.max_line_bytes = 500;
    limits.max_literal_bytes = 1000;
    ise::bytes_view rest(reinterpret_cast<const std::byte*>(input + 1), size - 1);
    std::size_t piece = input[0] % 64u + 1u;
    atirma::imap_replies whole(limits), pieces(limits);
    heard one, other;
    whole.push(rest);
    take(whole, one);
    while (!rest.empty()) {
        auto now = rest.first(std::min(piece, rest.size()));
        rest = rest.subspan(now.size());
        pieces.push(now);
        take(pieces, other);
    }
    if (!(one == other)) std::abort();
    return 0;
}
