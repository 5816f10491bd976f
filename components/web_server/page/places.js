// Names on the chart: [name or key of the texts, latitude, longitude, least zoom, first zoom without it, kind].
export default [
  ['Gran Canaria', 27.958, -15.600, 8, 20, 'land'], ['La Isleta', 28.171, -15.422, 12, 20, 'land'],
  ['Las Palmas', 28.106, -15.433, 11, 20, 'land'], ['Bahía del Confital', 28.143, -15.456, 13, 20, 'sea'],
  ['atlantic', 30, -42, 2, 6, 'sea'], ['caribbean', 14.8, -72, 4, 7, 'sea'],
  ['canaries', 29.1, -15.6, 4, 8, 'sea'], ['cape_verde', 15.6, -23.6, 4, 8, 'sea'],
  ['Madeira', 32.75, -16.95, 5, 9, 'land'], ['Açores', 38.6, -28.2, 4, 8, 'sea'],
  ['Barbados', 13.3, -59.55, 5, 9, 'land'],
];
