#pragma once
#include <components/boat/telemetry.hpp>

#include <QColor>
#include <QString>
#include <QStringList>

class QTableWidget;
class QVBoxLayout;
class QWidget;

// What all lists have in common.
namespace atirma::console {

/// A table of whole rows, which nobody edits.
QTableWidget* make_table(const QStringList& heads, const QString& name, QWidget* parent);
/// The tip is the text itself unless it is given: what is cut off can be read.
void set_cell(QTableWidget* table, int row, int column, const QString& words, const QColor& ink,
              const QString& tip = QString());
/// "17:30:05".
QString clock_of(utc_time at);
QVBoxLayout* column_of(QWidget* of);

} // namespace atirma::console
