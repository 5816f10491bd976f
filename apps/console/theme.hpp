#pragma once
#include <components/gui_client/alarm.hpp>
#include <components/gui_client/freshness.hpp>

#include <QColor>
#include <QFont>
#include <QString>

class QLabel;
class QWidget;

namespace atirma::console {

/// For daylight, for the night, and of red light only, which leaves the eyes used to the dark.
enum class palette : std::uint8_t { day, night, red };

struct theme {
    bool dark = false;
    QColor page, card, field, ink, ink2, ink3, line;
    QColor accent, good, warn, warn_back, bad, bad_back, notice_back;
    QColor sea, shore1, shore2, shore3, land, coast, place, sea_text, graticule;
    QColor route, leg, draft, no_go, true_wind, apparent_wind, hull, deck;
    QColor links[link_count];
    QColor link_other;

    const QColor& of(link_id link) const {
        return static_cast<std::size_t>(link) < link_count ? links[static_cast<std::size_t>(link)] : link_other;
    }
    /// The colour of the mark for a value's age.
    const QColor& of(freshness how) const;
    /// The colour of an alarm that is not acknowledged.
    const QColor& of(severity how) const;
    /// The colour of the value itself.
    const QColor& ink_of(freshness how) const;
};

/// The present one. Windows only, on their thread.
const theme& colours();
/// Changes it, and the look of all widgets.
void use_theme(palette which);

/// No text is smaller, in pixels.
inline constexpr int smallest_text = 14;
/// The font of a size in pixels, at least `smallest_text`.
QFont font_of(int pixels, QFont::Weight weight = QFont::Normal);
QString text(const std::string& utf8);

/// A label for markup of ours; text from outside must be escaped (toHtmlEscaped) before it is inserted.
QLabel* rich_label(QWidget* parent);
/// Makes all other labels and all tooltips show plain text: the boat, proxies and other operators cannot insert markup.
void show_texts_plainly();

} // namespace atirma::console
