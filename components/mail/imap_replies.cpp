#include <components/mail/imap_replies.hpp>

#include <components/mail/imap_text.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

/// The number in "… {123}" at the end of a line; nothing where no literal follows.
std::optional<std::uint64_t> literal_size(std::string_view line) {
    if (!line.ends_with('}')) return std::nullopt;
    auto open = line.rfind('{');
    if (open == std::string_view::npos) return std::nullopt;
    auto digits = line.substr(open + 1, line.size() - open - 2);
    if (digits.ends_with('+')) digits.remove_suffix(1);
    return imap_number(digits);
}

} // namespace

void imap_replies::push(ise::bytes_view piece) {
    if (broken_) return;
    if (begin_ > 0 && begin_ * 2 >= buffer_.size()) { // what was taken makes room
        buffer_.erase(0, begin_);
        looked_ = looked_ > begin_ ? looked_ - begin_ : 0;
        begin_ = 0;
    }
    buffer_.append(ise::as_text(piece));
}

ise::failure imap_replies::fail(ise::errc code, std::string what) {
    broken_.emplace(code, std::move(what));
    buffer_.clear();
    return *broken_;
}

ise::result<std::optional<imap_reply>> imap_replies::next() {
    if (broken_) return *broken_;
    for (;;) {
        if (in_literal_) {
            if (buffer_.size() - begin_ < wanted_) return std::optional<imap_reply>();
            literals_.push_back(buffer_.substr(begin_, wanted_));
            begin_ += wanted_;
            looked_ = begin_;
            in_literal_ = false;
        }
        auto end = buffer_.find('\n', std::max(begin_, looked_));
        auto piece = (end == std::string::npos ? buffer_.size() : end) - begin_;
        if (line_.size() + piece > limits_.max_line_bytes)
            return fail(ise::errc::too_large,
                        fmt::format("the server sends a line of more than {} bytes", limits_.max_line_bytes));
        if (end == std::string::npos) {
            looked_ = buffer_.size();
            return std::optional<imap_reply>();
        }
        line_.append(buffer_, begin_, piece);
        begin_ = looked_ = end + 1;
        if (line_.ends_with('\r')) line_.pop_back();
        if (auto size = literal_size(line_)) {
            if (*size > limits_.max_literal_bytes - held_)
                return fail(ise::errc::too_large, fmt::format("the server sends a text of {} bytes; {} are taken",
                                                              *size, limits_.max_literal_bytes));
            wanted_ = static_cast<std::size_t>(*size);
            held_ += wanted_;
            in_literal_ = true;
            continue;
        }
        break;
    }
    imap_reply made;
    made.literals = std::exchange(literals_, {});
    held_ = 0;
    auto line = std::exchange(line_, {});
    auto blank = line.find(' ');
    auto first = line.substr(0, blank);
    if (first == "*") made.what = imap_reply::kind::untagged;
    else if (first == "+") made.what = imap_reply::kind::continuation;
    else made.what = imap_reply::kind::tagged, made.tag = first;
    if (first.empty() || (blank == std::string::npos && first != "+"))
        return fail(ise::errc::malformed,
                    fmt::format("the server says \"{}\", which is not a reply of IMAP", imap_shown(line)));
    if (blank != std::string::npos) made.text = line.substr(blank + 1);
    return std::optional<imap_reply>(std::move(made));
}

} // namespace atirma
